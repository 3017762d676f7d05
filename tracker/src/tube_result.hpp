#pragma once

#include "tubetrack/tracker/follow.hpp"

namespace tubetrack {

/// A followed tube as a result: nodes about half a radius apart along its extent, in the camera frame.
Tube result_of(const FollowedTube& tube, const HeightMap& map);

/// Fills in `segments` and `bend_table` from the centreline (paper, section 3).
void add_parts(Tube& tube);

/// The same in the world frame.
void move_to_world(Tube& tube, const Eigen::Isometry3d& world_from_camera);

}  // namespace tubetrack
