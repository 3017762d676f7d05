#pragma once

#include <optional>

#include "tubetrack/tracker/grow.hpp"

namespace tubetrack {

/// One tube of which the camera sees two pieces, something nearer hiding what is between: where one piece's end runs on
/// smoothly into the other's, their radii agree, nothing speaks against the gap, and a fit to both agrees with the
/// image as well as they did apart. Empty where they are two tubes.
std::optional<FoundTube> join_pieces(const HeightMap& map, const TrackerConfig& config, const FoundTube& a,
                                     const FoundTube& b);

/// Does one's end run on into the other's, with a radius alike? Without it they are not joined; of their evidence only
/// the length is asked.
bool run_on(const FoundTube& a, const FoundTube& b);

/// Two fits of one tube: the centreline of one runs inside the other for the most part.
bool same_tube(const TubeModel& a, const Extent& a_extent, const TubeModel& b, const Extent& b_extent);

}  // namespace tubetrack
