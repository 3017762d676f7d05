#pragma once

#include <vector>

#include "race.hpp"
#include "tubetrack/sensors/intrinsics.hpp"

namespace tubetrack::bench {

/// The peers that this program was built with; FALS is the yardstick.
std::vector<PeerContender> speed_peers(const Intrinsics& camera);

}  // namespace tubetrack::bench
