#pragma once

#include <functional>
#include <vector>

#include "page.hpp"

namespace tubetrack::bench {

/// The rows `straight` and `bent` with all of the noise, with each part off in turn, with each part alone, and with
/// none: where a bias comes from. `scenes` of each row a step.
std::vector<AblationStep> run_ablation(int scenes, std::uint64_t first_seed, int jobs,
                                       const std::function<void()>& progress);

}  // namespace tubetrack::bench
