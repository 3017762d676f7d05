#include "tubetrack/report/calibration.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace tubetrack {

namespace {

template <class Entries, class Value>
double mean_over(const Entries& entries, Value value) {
  double sum = 0.0;
  double count = 0.0;
  for (const auto& entry : entries) {
    if (const std::optional<double> part = value(entry)) {
      sum += *part;
      count += 1.0;
    }
  }
  return count > 0.0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

/// The true tube that at least half of the reported line is on; null: none.
const TrueTube* true_tube_of(const TruthFrame& truth, const Tube& tube, const ScoreRules& rules) {
  const LineSamples samples = resample(tube.centerline_m, rules.sample_step_m);
  std::vector<std::size_t> on(truth.tubes.size(), 0);
  for (const Eigen::Vector3d& point : samples.points) {
    double nearest_radii = rules.false_beyond_radii;
    std::size_t nearest = on.size();
    for (std::size_t i = 0; i < on.size(); ++i) {
      const TrueTube& candidate = truth.tubes[i];
      const double radii = foot_on_line(point, candidate.centerline_m).distance_m / candidate.radius_m;
      if (radii > nearest_radii) continue;
      nearest_radii = radii;
      nearest = i;
    }
    if (nearest < on.size()) ++on[nearest];
  }
  const auto most = std::max_element(on.begin(), on.end());
  if (most == on.end() || *most == 0 || 2 * *most < samples.points.size()) return nullptr;
  return &truth.tubes[static_cast<std::size_t>(most - on.begin())];
}

/// The squared error across the line in units of the reported covariance there. A covariance that can't be inverted
/// claims to know the place exactly: any error is outside.
double chi2_across(const Eigen::Vector3d& error_m, const Eigen::Vector3d& along, const Eigen::Matrix3d& covariance) {
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = along.unitOrthogonal();
  across.col(1) = along.cross(across.col(0));
  const Eigen::Matrix2d section = across.transpose() * covariance * across;
  const Eigen::Vector2d error = across.transpose() * error_m;
  if (!(section.determinant() > 0.0 && section(0, 0) > 0.0)) return std::numeric_limits<double>::infinity();
  return error.dot(section.inverse() * error);
}

void add_nodes(Calibration& calibration, const TrueTube& truth, const Tube& tube,
               const Eigen::Isometry3d& camera_from_truth, const ScoreRules& rules) {
  const Eigen::Vector3d camera = camera_from_truth.inverse().translation();
  bool first = true;
  for (std::size_t i = 0; i < tube.node_covariance_m2.size(); ++i) {
    if (i < tube.node_visible.size() && !tube.node_visible[i]) continue;
    const LineFoot foot = foot_on_line(tube.centerline_m[i], truth.centerline_m);
    if (foot.beyond_end || foot.distance_m > rules.false_beyond_radii * truth.radius_m) continue;
    const Eigen::Vector3d error = tube.centerline_m[i] - foot.point_m;
    NodeError node;
    node.first = std::exchange(first, false);
    node.true_id = truth.id;
    node.true_radius_m = truth.radius_m;
    node.true_point_m = camera_from_truth * foot.point_m;
    const Eigen::Vector3d toward = (camera - foot.point_m).normalized();
    node.from_start_m = foot.from_start_m;
    node.toward_camera_m = error.dot(toward);
    node.sideways_m = error.dot(foot.along.cross(toward).normalized());
    node.sigma_m = i < tube.sigma_m.size() ? tube.sigma_m[i] : 0.0;
    node.chi2 = chi2_across(error, foot.along, tube.node_covariance_m2[i]);
    calibration.nodes.push_back(node);
  }
}

}  // namespace

double Calibration::nodes_inside() const {
  return mean_over(nodes, [](const NodeError& node) { return std::optional(node.inside() ? 1.0 : 0.0); });
}

double Calibration::radii_inside() const {
  return mean_over(tubes, [](const TubeError& tube) {
    return tube.true_id == 0 ? std::nullopt : std::optional(tube.inside() ? 1.0 : 0.0);
  });
}

double Calibration::toward_camera_m() const {
  return mean_over(nodes, [](const NodeError& node) { return std::optional(node.toward_camera_m); });
}

double Calibration::radius_error_m() const {
  return mean_over(tubes, [](const TubeError& tube) {
    return tube.true_id == 0 ? std::nullopt : std::optional(tube.radius_error_m);
  });
}

void add_frame(Calibration& calibration, const TruthFrame& truth, const TubeFrame& result,
               const Eigen::Isometry3d& camera_from_truth, const ScoreRules& rules) {
  for (const Tube& tube : result.tubes) {
    if (tube.centerline_m.empty()) continue;
    TubeError error;
    error.depth_m = (camera_from_truth * tube.centerline_m[tube.centerline_m.size() / 2]).z();
    error.length_m = tube.length_m;
    error.confidence = tube.confidence;
    error.radius_sigma_m = tube.radius_sigma_m;
    if (const TrueTube* match = true_tube_of(truth, tube, rules)) {
      error.true_id = match->id;
      error.true_radius_m = match->radius_m;
      error.radius_error_m = tube.radius_m - match->radius_m;
      add_nodes(calibration, *match, tube, camera_from_truth, rules);
    }
    calibration.tubes.push_back(error);
  }
}

double smoothing_radii(const Calibration& calibration) {
  constexpr double kBin_radii = 0.5;
  constexpr std::size_t kBins = 60;
  std::array<double, kBins> product{};
  std::array<double, kBins> count{};
  const auto& nodes = calibration.nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t j = i; j < nodes.size() && (j == i || !nodes[j].first); ++j) {
      const double apart_m = std::abs(nodes[j].from_start_m - nodes[i].from_start_m);
      const auto bin = static_cast<std::size_t>(std::lround(apart_m / nodes[i].true_radius_m / kBin_radii));
      if (bin >= kBins) break;
      product[bin] += nodes[i].sideways_m * nodes[j].sideways_m;
      count[bin] += 1.0;
    }
  }
  // The bin of 0 is half as wide as the others.
  if (!(product[0] > 0.0)) return std::numeric_limits<double>::quiet_NaN();
  double integral = 0.5;
  for (std::size_t bin = 1; bin < kBins; ++bin) {
    if (count[bin] == 0.0) continue;
    const double correlation = product[bin] / count[bin] / (product[0] / count[0]);
    if (correlation <= 0.0) break;
    integral += correlation;
  }
  return 2.0 * integral * kBin_radii;
}

}  // namespace tubetrack
