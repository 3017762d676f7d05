#pragma once

#include <Eigen/Core>
#include <vector>

#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/intrinsics.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack::bench {

// What both peers need around their cylinder detector.

// The range of radii a tube may have (TrackerConfig's).
constexpr double kLeastRadius_m = 0.005;
constexpr double kLargestRadius_m = 0.100;

/// `ray_table`, made once for a camera and thread and not again in every frame.
const std::vector<Eigen::Vector2f>& rays_of(const Intrinsics& camera);

/// The frame's points in the camera's frame, without those of large planes: walls and table tops, which the detectors
/// would otherwise spend their time on.
std::vector<Eigen::Vector3d> points_off_planes(const DepthFrame& frame, const Intrinsics& camera);

/// A cylinder without ends, as the detectors give it.
struct Cylinder {
  Eigen::Vector3d point_m;
  Eigen::Vector3d direction;
  double radius_m = 0.0;
};

/// Cuts the cylinder where its points leave a gap, and keeps pieces that could be tubes: long enough, and with enough
/// points for the surface they claim.
std::vector<Tube> straight_pieces(const Cylinder& cylinder, const std::vector<Eigen::Vector3d>& points,
                                  double focal_px);

}  // namespace tubetrack::bench
