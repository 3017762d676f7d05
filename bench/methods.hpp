#pragma once

#include <vector>

#include "run.hpp"

namespace tubetrack::bench {

/// The peers that this program was built with.
std::vector<Method> peer_methods();

}  // namespace tubetrack::bench
