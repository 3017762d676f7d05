#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "tubetrack/replay/synthetic_scene.hpp"

namespace tubetrack {

/// One part of a tube, placed in the world (at time 0).
struct PlacedPart {
  TubePart::Type type = TubePart::Type::straight;
  double from_m = 0.0;  ///< arc length along the tube
  double length_m = 0.0;
  Eigen::Vector3d start_m;
  Eigen::Vector3d tangent;     ///< unit, at the start
  Eigen::Vector3d towards;     ///< unit, across the tangent: where the arc's centre lies
  double bend_radius_m = 0.0;  ///< arc only
};

std::vector<PlacedPart> place_parts(const SceneTube& tube);

/// A point of the centreline with its unit tangent.
struct CenterlinePoint {
  Eigen::Vector3d position_m;
  Eigen::Vector3d tangent;
};

/// The point `along_m` behind the part's start.
CenterlinePoint point_on_part(const PlacedPart& part, double along_m);

/// Every `step_m` from cap to cap, and the far cap itself.
std::vector<CenterlinePoint> sample_centerline(const std::vector<PlacedPart>& parts, double step_m);

/// The tube's radius at an arc length.
double radius_along_m(const SceneTube& tube, double along_m);

/// The largest, and the mean over the tube's length.
double largest_radius_m(const SceneTube& tube);
double mean_radius_m(const SceneTube& tube);

double total_length_m(const std::vector<PlacedPart>& parts);

}  // namespace tubetrack
