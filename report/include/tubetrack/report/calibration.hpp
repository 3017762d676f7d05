#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tubetrack/replay/tube_truth.hpp"
#include "tubetrack/report/score.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// χ² with two degrees of freedom that 95 % stay below: −2 ln 0.05.
constexpr double kChi2Of95Percent = 5.991464547107979;
/// The same for a single normal number, in σ.
constexpr double kSigmasOf95Percent = 1.959963984540054;

/// One visible node of a reported tube, against the nearest point of the true centreline.
struct NodeError {
  bool first = false;  ///< of its tube: the nodes of a tube stand together, in order
  std::int64_t true_id = 0;
  double true_radius_m = 0.0;
  Eigen::Vector3d true_point_m = Eigen::Vector3d::Zero();  ///< in the camera's frame
  double from_start_m = 0.0;                               ///< arc length of the true centreline there
  double toward_camera_m = 0.0;                            ///< signed: positive is reported too near
  double sideways_m = 0.0;                                 ///< signed: across the tube and the ray
  double sigma_m = 0.0;                                    ///< as reported: the larger axis across the tube
  double chi2 = 0.0;  ///< of the error across the true centreline in the reported covariance; 2 degrees of freedom

  bool inside() const { return chi2 <= kChi2Of95Percent; }
};

/// One reported tube.
struct TubeError {
  std::int64_t true_id = 0;  ///< the true tube that at least half of its length lies on; 0: it is no tube
  double true_radius_m = 0.0;
  double depth_m = 0.0;         ///< z of its middle in the camera's frame
  double radius_error_m = 0.0;  ///< signed: positive is reported too thick
  double radius_sigma_m = 0.0;
  double length_m = 0.0;
  double confidence = 0.0;

  bool inside() const { return std::abs(radius_error_m) <= kSigmasOf95Percent * radius_sigma_m; }
};

/// How far errors and reported uncertainties are apart, node by node and tube by tube.
struct Calibration {
  std::vector<NodeError> nodes;
  std::vector<TubeError> tubes;

  double nodes_inside() const;     ///< share of the nodes whose 95 % interval holds the truth; NaN without nodes
  double radii_inside() const;     ///< the same of the true tubes' radii
  double toward_camera_m() const;  ///< mean over the nodes
  double radius_error_m() const;   ///< mean over the true tubes
};

/// Over how many tube radii errors sideways are alike: the length of a box filter whose output would be correlated
/// as they are (twice the integral of their correlation up to where it vanishes). NaN where there is too little. Errors
/// sideways hardly depend on the radius, which is one for the whole tube.
double smoothing_radii(const Calibration& calibration);

/// Adds one frame. Nodes count where they are flagged visible, within ScoreRules::false_beyond_radii of the true
/// centreline of the tube theirs was found on, and not past its ends.
void add_frame(Calibration& calibration, const TruthFrame& truth, const TubeFrame& result,
               const Eigen::Isometry3d& camera_from_truth, const ScoreRules& rules);

}  // namespace tubetrack
