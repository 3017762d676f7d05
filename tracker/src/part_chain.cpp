#include "tubetrack/tracker/part_chain.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace tubetrack {

PlacedChain place(const PartChain& chain) {
  PlacedChain placed;
  placed.bends.reserve(chain.bends.size());
  Eigen::Vector3d at_m = chain.start_m;
  Eigen::Vector3d tangent = chain.direction;
  Eigen::Vector3d towards = chain.towards;
  double from_m = 0.0;
  for (const ChainBend& bend : chain.bends) {
    PlacedBend next;
    next.straight_start_m = at_m;
    next.arc_start_m = at_m + bend.straight_m * tangent;
    next.tangent = tangent;
    next.towards = std::cos(bend.rotation_rad) * towards + std::sin(bend.rotation_rad) * tangent.cross(towards);
    next.axis = tangent.cross(next.towards);
    next.radius_m = bend.radius_m;
    next.center_m = next.arc_start_m + bend.radius_m * next.towards;
    next.arc_from_m = from_m + bend.straight_m;
    next.arc_to_m = next.arc_from_m + bend.radius_m * bend.angle_rad;
    const double sine = std::sin(bend.angle_rad);
    const double cosine = std::cos(bend.angle_rad);
    at_m = next.center_m + bend.radius_m * (sine * tangent - cosine * next.towards);
    tangent = (cosine * next.tangent + sine * next.towards).normalized();
    towards = next.axis.cross(tangent).normalized();
    from_m = next.arc_to_m;
    placed.bends.push_back(next);
  }
  placed.last_start_m = at_m;
  placed.last_tangent = tangent;
  placed.last_towards = towards;
  placed.last_from_m = from_m;
  return placed;
}

ChainPoint point_on(const PlacedChain& chain, double along_m) {
  ChainPoint point;
  while (point.bend < chain.bends.size() && along_m > chain.bends[point.bend].arc_to_m) ++point.bend;
  if (point.bend == chain.bends.size()) {
    point.position_m = chain.last_start_m + (along_m - chain.last_from_m) * chain.last_tangent;
    point.tangent = chain.last_tangent;
    point.normal = chain.last_towards;
    return point;
  }
  const PlacedBend& bend = chain.bends[point.bend];
  const double into_arc_m = along_m - bend.arc_from_m;
  if (into_arc_m < 0.0) {
    point.position_m = bend.arc_start_m + into_arc_m * bend.tangent;
    point.tangent = bend.tangent;
    point.normal = bend.towards;
    return point;
  }
  const double sine = std::sin(into_arc_m / bend.radius_m);
  const double cosine = std::cos(into_arc_m / bend.radius_m);
  point.in_arc = true;
  point.curvature_per_m = 1.0 / bend.radius_m;
  point.tangent = cosine * bend.tangent + sine * bend.towards;
  point.normal = cosine * bend.towards - sine * bend.tangent;
  point.position_m = bend.center_m - bend.radius_m * point.normal;
  return point;
}

double length_of(const PartChain& chain) {
  double length_m = chain.closing_m;
  for (const ChainBend& bend : chain.bends) length_m += bend.straight_m + bend.radius_m * bend.angle_rad;
  return length_m;
}

std::vector<Eigen::Vector3d> points_along(const PartChain& chain, double step_m) {
  std::vector<Eigen::Vector3d> points;
  constexpr double kMostPoints = 1e7;
  if (!(step_m > 0.0) || !(length_of(chain) < kMostPoints * step_m)) return points;
  const PlacedChain placed = place(chain);
  double at_m = 0.0;
  points.push_back(chain.start_m);
  const auto add_part = [&](double length_m) {
    const int steps = static_cast<int>(std::ceil(length_m / step_m - 1e-9));
    for (int i = 1; i <= steps; ++i) points.push_back(point_on(placed, at_m + length_m * i / steps).position_m);
    at_m += length_m;
  };
  for (const ChainBend& bend : chain.bends) {
    add_part(bend.straight_m);
    add_part(bend.radius_m * bend.angle_rad);
  }
  add_part(chain.closing_m);
  return points;
}

}  // namespace tubetrack
