#pragma once

#include "tubetrack/replay/synthetic_scene.hpp"

namespace tubetrack::test {

/// Distance to a tube's centreline at time 0 and whether the point lies within the tube; written anew, from the scene's
/// definition, with a frame carried along the tube by rotations.
struct CenterlineDistance {
  double distance_m = 0.0;
  bool beside = false;        ///< the nearest point is no end, or the point lies on the tube's side of that end's cap
  double beyond_cap_m = 0.0;  ///< signed distance past the nearer end's cap, when the nearest point is an end
};
CenterlineDistance distance_to_centerline(const SceneTube& tube, const Eigen::Vector3d& point_m);

/// Whether a world point lies inside any tube or solid at a time (planes: on the far side of the camera's origin;
/// bowls: never, they are thin).
bool inside_scene(const Scene& scene, double time_s, const Eigen::Vector3d& point_m);

}  // namespace tubetrack::test
