#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {

inline constexpr int kStretchesPerSpan = 8;

/// What the observations of one short stretch say of the centreline's point there and the radius: sums over their terms
/// (`residual_of`), each weighted by 1/σ².
struct StretchSums {
  Eigen::Matrix3d point_point = Eigen::Matrix3d::Zero();
  Eigen::Vector3d point_radius = Eigen::Vector3d::Zero();
  Eigen::Vector3d point_residual = Eigen::Vector3d::Zero();
  double radius_radius = 0.0;
  double radius_residual = 0.0;
  double chi2 = 0.0;
  int used = 0;  ///< whose ray meets the tube well
};

/// Observations side by side, as `sum_stretches` takes them; those that only fill up have no weight.
inline constexpr std::size_t kPartials = 8;
struct ObservationBlock {
  using Row = std::array<double, kPartials>;
  Row x, y, z;  ///< measured point
  Row direction_x, direction_y, direction_z;
  Row weight;  ///< 1/σ²
  Row s;       ///< place on the centreline, in spans from the start of its span
};

/// Blocks stretch by stretch, of a centreline with so many spans; each stretch starts a block of its own.
struct SortedObservations {
  std::vector<ObservationBlock> blocks;
  std::vector<std::size_t> first;  ///< of each stretch, and one more
};
SortedObservations sort_by_stretch(std::span<const Observation> observations, std::size_t spans);

/// One for each eighth of a span. An observation counts where it is expected (`Observation::t`): its own foot on the
/// centreline decides its residual, but not its stretch or span.
std::vector<StretchSums> sum_stretches(const TubeModel& model, const SortedObservations& observations);

}  // namespace tubetrack
