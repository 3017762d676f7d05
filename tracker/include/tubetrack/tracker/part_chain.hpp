#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// A bend with the straight that leads to it.
struct ChainBend {
  double straight_m = 0.0;    ///< length of the straight before the bend, ≥ 0
  double rotation_rad = 0.0;  ///< turn of the bend's plane about that straight since the bend before, right-handed
  double angle_rad = 0.0;     ///< > 0
  double radius_m = 0.0;      ///< of the centreline
  bool touching = false;      ///< there is no straight, and none is looked for
};

/// A tangent-continuous centreline of straights and circular arcs (paper, section 3: rectilinear and toric parts), as a
/// tube bender makes it. In the frame of its points.
struct PartChain {
  Eigen::Vector3d start_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< unit, at the start
  Eigen::Vector3d towards = Eigen::Vector3d::UnitY();    ///< unit, across `direction`: where a bend of rotation 0 goes
  RecycledVector<ChainBend> bends;
  double closing_m = 0.0;  ///< length of the last straight, ≥ 0
};

/// A bend in its place.
struct PlacedBend {
  Eigen::Vector3d straight_start_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d arc_start_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d tangent = Eigen::Vector3d::UnitX();  ///< unit, of the straight
  Eigen::Vector3d towards = Eigen::Vector3d::UnitY();  ///< unit, from the arc's start to its centre
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();     ///< unit, tangent × towards: the bend turns about it
  double radius_m = 0.0;
  double arc_from_m = 0.0;  ///< arc length from the chain's start
  double arc_to_m = 0.0;
};

struct PlacedChain {
  RecycledVector<PlacedBend> bends;
  Eigen::Vector3d last_start_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d last_tangent = Eigen::Vector3d::UnitX();
  Eigen::Vector3d last_towards = Eigen::Vector3d::UnitY();
  double last_from_m = 0.0;
};

PlacedChain place(const PartChain& chain);

/// A point of a chain. `bend` is the bend that it lies on or before; their number on the last straight.
struct ChainPoint {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d tangent = Eigen::Vector3d::UnitX();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< across the tangent; in a bend: to its centre
  double curvature_per_m = 0.0;
  std::size_t bend = 0;
  bool in_arc = false;
};

/// The point `along_m` behind the chain's start; beyond the ends the chain goes on straight.
ChainPoint point_on(const PlacedChain& chain, double along_m);

double length_of(const PartChain& chain);

/// Points at most `step_m` apart, the chain's ends and those of its parts among them. Empty where `step_m` is not
/// positive, or so small that there would be more than ten million.
std::vector<Eigen::Vector3d> points_along(const PartChain& chain, double step_m);

}  // namespace tubetrack
