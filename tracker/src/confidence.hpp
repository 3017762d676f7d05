#pragma once

#include "tubetrack/tracker/follow.hpp"

namespace tubetrack {

/// Takes in what one look at a tube says of its taper.
void add_look(FollowedTube& tube, const Evidence& evidence);

/// How surely it is a tube, 0…1: the part of its camera-facing surface that the frame confirms, times the chance, after
/// all looks at it, that its taper is below the 5 % that a tube may have. 0 while it is out of sight.
double confidence_of(const FollowedTube& tube);

}  // namespace tubetrack
