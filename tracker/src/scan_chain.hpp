#pragma once

#include <optional>
#include <vector>

#include "scan_grow.hpp"
#include "tubetrack/tracker/segments.hpp"

namespace tubetrack {

/// The chain of a tube fitted once more, to the surface itself (paper, section 2.3, all parts at once): a line of knots
/// rounds off where a bend begins, a chain does not. The radius is free unless config has it. σ's are those of the
/// surfels' residuals, summed over patches of the surface, since neighbouring surfels of a mesh share their corners and
/// err together. Nothing where the chain, whose number of bends stays, does not fit as well as the tube's own line, and
/// where it begins or ends within a bend.
std::optional<FittedChain> fit_chain_to_surface(const PartChain& initial, const ScanTube& tube, const SurfelGrid& grid,
                                                const ScanTubesConfig& config);

}  // namespace tubetrack
