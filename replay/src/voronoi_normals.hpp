#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace tubetrack {

/// Lengths of the Voronoi covariance measure, in metres.
struct VoronoiScale {
  double step_m = 0.0;    ///< of the lattice that space is sampled on: the grid's own step
  double offset_m = 0.0;  ///< R: how far from the points space is looked at
  double radius_m = 0.0;  ///< r: over which measures are averaged, by a hat
};

// R and r over the size that the other estimators take: on tori the error falls with both, and what is beside a thin
// tube comes in (docs/paper.md).
constexpr double kVoronoiOffset = 1.5, kVoronoiRadius = 1.5;

/// Unit outward normals of a digital surface's points, by the Voronoi covariance measure (Cuel, Lachaud, Thibert 2014;
/// paper, section 3): each point gathers (x − p)(x − p)ᵀ over the places x within R that are nearest to it; averaged
/// over the points within r, the eigenvector of the largest eigenvalue is the normal. Its sign is that of `outward`
/// summed over the same points (one a point, of any length). Where nothing decides, `outward` itself. The time grows
/// with the number of points times R³ and r².
std::vector<Eigen::Vector3f> voronoi_normals(std::span<const Eigen::Vector3d> points_m,
                                             std::span<const Eigen::Vector3d> outward, const VoronoiScale& scale);

}  // namespace tubetrack
