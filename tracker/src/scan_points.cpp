#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_map>

#include "scan_fit.hpp"
#include "tubetrack/tracker/packed_cell.hpp"

namespace tubetrack {

namespace {

constexpr int kNodesPerSpan = 2;
constexpr double kNearestRadii = 0.5, kFarthestRadii = 1.5;
constexpr double kLeastFacing = 0.5;  // 60°
constexpr double kMostAlong = 0.4;    // 24°

/// Nodes of a line by the cell of a coarse grid that they can be near to.
class NodeGrid {
 public:
  NodeGrid(const Spline& spline, double reach_m) : cell_m_(reach_m) {
    const int count = static_cast<int>(spline.spans()) * kNodesPerSpan;
    for (int i = 0; i <= count; ++i) {
      nodes_m_.push_back(point_at(spline, static_cast<double>(i) / kNodesPerSpan));
      box_.extend(nodes_m_.back());
      for (int k = 0; k < 27; ++k) {
        const Eigen::Vector3d shift = reach_m * Eigen::Vector3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1).cast<double>();
        nodes_of_[packed_cell(nodes_m_.back() + shift, cell_m_)].push_back(static_cast<std::uint32_t>(i));
      }
    }
    box_.min().array() -= reach_m;
    box_.max().array() += reach_m;
  }

  /// The nearest node's parameter; negative where none is within reach.
  double nearest(const Eigen::Vector3d& point_m) const {
    if (!box_.contains(point_m)) return -1.0;
    const auto cell = nodes_of_.find(packed_cell(point_m, cell_m_));
    if (cell == nodes_of_.end()) return -1.0;
    double least = cell_m_ * cell_m_;
    double t = -1.0;
    for (const std::uint32_t node : cell->second) {
      const double squared = (nodes_m_[node] - point_m).squaredNorm();
      if (squared >= least) continue;
      least = squared;
      t = static_cast<double>(node) / kNodesPerSpan;
    }
    return t;
  }

 private:
  double cell_m_;
  std::vector<Eigen::Vector3d> nodes_m_;
  Eigen::AlignedBox3d box_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> nodes_of_;
};

struct Foot {
  double t = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero(), derivative_m = Eigen::Vector3d::UnitX();
};

/// As foot_parameter, to a hundredth of a span: of a distance of R that is less than a ten-thousandth.
Foot foot_on(const RecycledVector<SpanPolynomial>& curve, const Eigen::Vector3d& point_m, double t) {
  const auto spans = static_cast<double>(curve.size());
  Foot foot;
  foot.t = std::clamp(t, 0.0, spans);
  constexpr int kRounds = 3;
  for (int i = 0;; ++i) {
    const std::size_t span = std::min(static_cast<std::size_t>(foot.t), curve.size() - 1);
    const auto& [c0, c1, c2, c3] = curve[span];
    const double s = foot.t - static_cast<double>(span);
    foot.position_m = c0 + s * (c1 + s * (c2 + s * c3));
    foot.derivative_m = c1 + s * (2.0 * c2 + (3.0 * s) * c3);
    const double speed2 = foot.derivative_m.squaredNorm();
    if (i == kRounds || !(speed2 > 0.0)) return foot;
    const double step = std::clamp((point_m - foot.position_m).dot(foot.derivative_m) / speed2, -0.5, 0.5);
    const double next = std::clamp(foot.t + step, 0.0, spans);
    if (std::abs(next - foot.t) < 0.01) return foot;
    foot.t = next;
  }
}

}  // namespace

std::vector<SurfacePoint> points_near(std::span<const Surfel> surfels, std::span<const char> taken,
                                      const ScanLine& line) {
  const Spline& spline = line.model.spline;
  const double radius_m = line.model.radius_m;
  // A node's own distance and half of that to the next one, which a bend may widen.
  const double reach_m = (kFarthestRadii + 0.5 * kKnotSpacingRadii) * radius_m;
  const NodeGrid grid(spline, reach_m);
  const RecycledVector<SpanPolynomial> curve = polynomials_of(spline);
  std::vector<SurfacePoint> points;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (!taken.empty() && taken[i] != 0) continue;
    const Eigen::Vector3d point_m = surfels[i].position_m.cast<double>();
    const double nearest = grid.nearest(point_m);
    if (nearest < 0.0) continue;
    SurfacePoint point;
    point.surfel = static_cast<std::uint32_t>(i);
    const Foot foot = foot_on(curve, point_m, nearest);
    point.t = foot.t;
    const Eigen::Vector3d to_axis = foot.position_m - point_m;
    point.distance_m = to_axis.norm();
    if (point.distance_m < kNearestRadii * radius_m || point.distance_m > kFarthestRadii * radius_m) continue;
    point.inward = to_axis / point.distance_m;
    // Beyond an end the foot stays there.
    const Eigen::Vector3d along = foot.derivative_m.normalized();
    if (std::abs(point.inward.dot(along)) > 0.1) continue;
    const Eigen::Vector3d normal = surfels[i].inward_normal.cast<double>();
    point.facing = point.inward.dot(normal);
    if (point.facing < kLeastFacing || std::abs(along.dot(normal)) > kMostAlong) continue;
    points.push_back(point);
    if (!line.closed()) continue;
    const double again = point.t + (point.t < 0.5 * spline.spans() ? line.period : -line.period);
    if (again < 0.0 || again > spline.spans()) continue;
    point.t = again;
    points.push_back(point);
  }
  return points;
}

}  // namespace tubetrack
