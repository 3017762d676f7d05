#pragma once

#include <Eigen/Core>
#include <span>

namespace tubetrack {

struct OrientedPoint {
  Eigen::Vector3d position_m;
  Eigen::Vector3d normal;  ///< unit
};

/// On which side of the surface the axis of its tubes lies.
enum class VoteSide { along_normals, against_normals, undecided };

/// The side on which the votes of the paper's algorithm 1 concentrate: lines along consistently oriented normals meet
/// on the axis, and fan out on the other side. `spacing_m`: distance between neighbouring points. Flat pieces count
/// alike on both sides; `undecided` where there is little else, in crumbs, and of fewer than a dozen points.
VoteSide concentrated_side(std::span<const OrientedPoint> points, double spacing_m);

}  // namespace tubetrack
