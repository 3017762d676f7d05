#pragma once

#include <Eigen/Core>
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

/// One for each eighth of a span. An observation counts where it is expected (`Observation::t`): its own foot on the
/// centreline decides its residual, but not its stretch or span.
std::vector<StretchSums> sum_stretches(const TubeModel& model, std::span<const Observation> observations);

}  // namespace tubetrack
