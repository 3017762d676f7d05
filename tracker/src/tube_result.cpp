#include "tube_result.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>

#include "confidence.hpp"
#include "tubetrack/tracker/bend_table.hpp"

namespace tubetrack {

namespace {

constexpr double kCornerCut = 0.01;  // of the spline's third difference
// Of a tube out of sight, one σ: how fast one at rest may creep, and by how much one in motion may change its speed.
constexpr double kUnseenCreep_m_s = 0.001;
constexpr double kUnseenAcceleration_m_s2 = 1.0;

/// The larger σ across a line of this direction.
double sigma_across_m(const Eigen::Matrix3d& covariance_m2, const Eigen::Vector3d& along) {
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = along.unitOrthogonal();
  across.col(1) = along.cross(across.col(0));
  const Eigen::Matrix2d section = across.transpose() * covariance_m2 * across;
  const double mean = 0.5 * section.trace();
  return std::sqrt(std::max(0.0, mean + std::hypot(0.5 * (section(0, 0) - section(1, 1)), section(0, 1))));
}

/// Of a tube whose radius varies.
void add_node_radius(const FollowedTube& followed, double t, Tube& tube) {
  const RadiusProfile& profile = followed.model.profile;
  if (profile.offset_m.empty()) return;
  const double radius_m = radius_at(followed.model, t);
  tube.node_radius_m.push_back(radius_m);
  const RecycledMatrix& covariance = followed.quality.profile_covariance;
  if (covariance.rows() != static_cast<Eigen::Index>(profile.offset_m.size())) return;
  const SplineBasis basis = profile_basis_at(profile, followed.model.spline, t);
  const auto first = static_cast<Eigen::Index>(basis.first);
  const Eigen::Vector4d weights = Eigen::Vector4d::Map(basis.value.data());
  const double variance = weights.dot(covariance.block<4, 4>(first, first) * weights);
  tube.node_radius_sigma_m.push_back(std::sqrt(std::max(0.0, variance) + std::pow(kRoundness * radius_m, 2)));
}

/// Of stations in order of t, the one that a place is nearest to; null where there are none.
const Station* nearest(const RecycledVector<Station>& stations, double t) {
  if (stations.empty()) return nullptr;
  const auto after = std::ranges::lower_bound(stations, t, {}, &Station::t);
  if (after == stations.begin()) return &*after;
  const auto before = std::prev(after);
  return after == stations.end() || t - before->t <= after->t - t ? &*before : &*after;
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

double polyline_length_m(const std::vector<Eigen::Vector3d>& line_m) {
  double length_m = 0.0;
  for (std::size_t i = 1; i < line_m.size(); ++i) length_m += (line_m[i] - line_m[i - 1]).norm();
  return length_m;
}

void add_uncertainty(const Spline& spline, const RecycledMatrix& control_covariance, double t, Tube& tube) {
  const SplineBasis basis = basis_at(spline, t);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      const auto row = static_cast<Eigen::Index>(3 * (basis.first + i));
      const auto col = static_cast<Eigen::Index>(3 * (basis.first + j));
      covariance += basis.value[i] * basis.value[j] * control_covariance.block<3, 3>(row, col);
    }
  }
  add_place_uncertainty(spline, covariance, t, tube);
}

void add_place_uncertainty(const Spline& spline, Eigen::Matrix3d covariance_m2, double t, Tube& tube) {
  // Where a bend begins or ends, the spline cuts the corner that its knots are too far apart for.
  const auto& q = spline.control_m;
  const std::size_t k = basis_at(spline, t).first;
  const double third_m = (q[k + 3] - q[k] + 3.0 * (q[k + 1] - q[k + 2])).norm();
  covariance_m2.diagonal().array() += kCornerCut * kCornerCut * third_m * third_m;
  tube.sigma_m.push_back(sigma_across_m(covariance_m2, derivative_at(spline, t).normalized()));
  tube.node_covariance_m2.push_back(covariance_m2);
}

void set_result(const FollowedTube& followed, const HeightMap& map, Tube& tube) {
  tube.centerline_m.clear();
  tube.sigma_m.clear();
  tube.node_covariance_m2.clear();
  tube.node_visible.clear();
  tube.node_radius_m.clear();
  tube.node_radius_sigma_m.clear();
  tube.id = followed.id;
  tube.state = followed.state;
  tube.radius_m = followed.model.radius_m;
  tube.radius_sigma_m = followed.quality.radius_sigma_m;
  tube.confidence = confidence_of(followed);
  const Extent& extent = followed.extent;
  const Spline& spline = followed.model.spline;
  const double chord_m =
      (point_at(spline, 0.5 * spline.spans() + 0.5) - point_at(spline, 0.5 * spline.spans() - 0.5)).norm();
  const double spacing_m =
      std::max(std::clamp(0.5 * tube.radius_m, 0.002, 0.02), station_length_m(map, followed.model));
  const int spans = std::max(2, static_cast<int>(std::ceil((extent.t_end - extent.t_begin) * chord_m / spacing_m)));
  for (int i = 0; i <= spans; ++i) {
    const double t = extent.t_begin + (extent.t_end - extent.t_begin) * i / spans;
    tube.centerline_m.push_back(point_at(spline, t));
    const Station* station = nearest(followed.stations, t);
    tube.node_visible.push_back(followed.state == TubeState::tracked && station && station->seen());
    add_uncertainty(spline, followed.quality.covariance, t, tube);
    add_node_radius(followed, t, tube);
  }
  if (!tube.node_radius_m.empty()) tube.radius_m = mean(tube.node_radius_m);
  tube.length_m = polyline_length_m(tube.centerline_m);
}

void add_parts(Tube& tube) {
  set_parts(cut_into_parts(fitted_centerline(tube)), tube);
}

void set_parts(const CenterlineParts& parts, Tube& tube) {
  tube.segments.assign(parts.segments.begin(), parts.segments.end());
  tube.bend_table.xyz_m.clear();
  tube.bend_table.lra.clear();
  if (parts.fitted) add_bends(*parts.fitted, tube.bend_table);
}

void add_unseen_motion(Tube& tube, const FollowedTube& followed, double timestamp_s) {
  if (followed.state == TubeState::tracked) return;
  const double unseen_s = std::max(0.0, timestamp_s - followed.last_seen_s);
  const double sigma_m =
      followed.at_rest ? kUnseenCreep_m_s * unseen_s : 0.5 * kUnseenAcceleration_m_s2 * unseen_s * unseen_s;
  for (std::size_t i = 0; i < tube.sigma_m.size(); ++i) {
    tube.node_covariance_m2[i].diagonal().array() += sigma_m * sigma_m;
    tube.sigma_m[i] = std::hypot(tube.sigma_m[i], sigma_m);
  }
}

void add_common_error(Tube& tube, double radius_relative) {
  const double sigma_m = radius_relative * tube.radius_m;
  if (sigma_m <= 0.0) return;
  tube.radius_sigma_m = std::hypot(tube.radius_sigma_m, sigma_m);
  for (double& node_sigma_m : tube.node_radius_sigma_m) node_sigma_m = std::hypot(node_sigma_m, sigma_m);
  const auto& line = tube.centerline_m;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const Eigen::Vector3d along = (line[std::min(i + 1, line.size() - 1)] - line[i == 0 ? 0 : i - 1]).normalized();
    const Eigen::Vector3d away = (line[i] - line[i].dot(along) * along).normalized();
    tube.node_covariance_m2[i] += sigma_m * sigma_m * away * away.transpose();
    tube.sigma_m[i] = sigma_across_m(tube.node_covariance_m2[i], along);
  }
}

void move_to_world(Tube& tube, const Eigen::Isometry3d& world_from_camera) {
  for (Eigen::Vector3d& point : tube.centerline_m) point = world_from_camera * point;
  for (Eigen::Vector3d& point : tube.bend_table.xyz_m) point = world_from_camera * point;
  for (Eigen::Matrix3d& covariance : tube.node_covariance_m2) {
    covariance = world_from_camera.linear() * covariance * world_from_camera.linear().transpose();
  }
}

}  // namespace tubetrack
