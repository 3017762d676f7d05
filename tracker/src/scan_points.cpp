#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "scan_fit.hpp"
#include "tubetrack/tracker/packed_cell.hpp"

namespace tubetrack {

namespace {

constexpr int kNodesPerSpan = 2;
constexpr double kNearestRadii = 0.5, kFarthestRadii = 1.5;
constexpr double kLeastFacing = 0.5;  // 60°
constexpr double kMostAlong = 0.4;    // 24°

/// Nodes of a line by the cell of a coarse grid.
class NodeGrid {
 public:
  NodeGrid(const Spline& spline, double reach_m) : cell_m_(reach_m) {
    const int count = static_cast<int>(spline.spans()) * kNodesPerSpan;
    for (int i = 0; i <= count; ++i) {
      nodes_m_.push_back(point_at(spline, static_cast<double>(i) / kNodesPerSpan));
      box_.extend(nodes_m_.back());
      sorted_.emplace_back(packed_cell(nodes_m_.back(), cell_m_), static_cast<std::uint32_t>(i));
    }
    std::sort(sorted_.begin(), sorted_.end());
    box_.min().array() -= reach_m;
    box_.max().array() += reach_m;
  }

  /// What is within reach of a node.
  const Eigen::AlignedBox3d& box() const { return box_; }
  /// Those within reach. Quick where the last point was near this one.
  void nodes_near(const Eigen::Vector3d& point_m, std::vector<std::uint32_t>& near) {
    near.clear();
    if (!box_.contains(point_m)) return;
    if (const std::uint64_t cell = packed_cell(point_m, cell_m_); cell != last_cell_) gather(point_m, cell);
    for (const std::uint32_t node : around_) {
      if ((nodes_m_[node] - point_m).squaredNorm() < cell_m_ * cell_m_) near.push_back(node);
    }
  }

  /// The nearest of some: its parameter; negative where none is within `reach_m`.
  double nearest(const Eigen::Vector3d& point_m, const std::vector<std::uint32_t>& among, double reach_m) const {
    double least = reach_m * reach_m;
    double t = -1.0;
    for (const std::uint32_t node : among) {
      const double squared = (nodes_m_[node] - point_m).squaredNorm();
      if (squared >= least) continue;
      least = squared;
      t = static_cast<double>(node) / kNodesPerSpan;
    }
    return t;
  }

 private:
  /// The nodes of the cell and of those around it, three in a row at a time.
  void gather(const Eigen::Vector3d& point_m, std::uint64_t cell) {
    last_cell_ = cell;
    around_.clear();
    for (int row = 0; row < 9; ++row) {
      const Eigen::Vector3d middle_m = point_m + cell_m_ * Eigen::Vector3i(0, row % 3 - 1, row / 3 - 1).cast<double>();
      const std::uint64_t key = packed_cell(middle_m, cell_m_);
      auto at = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(key - 1, std::uint32_t{0}));
      for (; at != sorted_.end() && at->first <= key + 1; ++at) around_.push_back(at->second);
    }
    std::sort(around_.begin(), around_.end());
  }

  double cell_m_;
  std::vector<Eigen::Vector3d> nodes_m_;
  Eigen::AlignedBox3d box_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> sorted_;  // cell and node
  std::uint64_t last_cell_ = ~std::uint64_t{0};
  std::vector<std::uint32_t> around_;
};

struct Foot {
  double t = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero(), derivative_m = Eigen::Vector3d::UnitX();
  Eigen::Vector3d second_m = Eigen::Vector3d::Zero();
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
    foot.second_m = 2.0 * c2 + (6.0 * s) * c3;
    if (i == kRounds || !(speed2 > 0.0)) return foot;
    const double step = std::clamp((point_m - foot.position_m).dot(foot.derivative_m) / speed2, -0.5, 0.5);
    const double next = std::clamp(foot.t + step, 0.0, spans);
    if (std::abs(next - foot.t) < 0.01) return foot;
    foot.t = next;
  }
}

double along_axis(const SurfelSpread& spread, const Eigen::Vector3d& axis) {
  const auto& [xx, xy, xz, yy, yz, zz] = spread;
  const double x = axis.x(), y = axis.y(), z = axis.z();
  return x * (xx * x + 2.0 * (xy * y + xz * z)) + y * (yy * y + 2.0 * yz * z) + zz * z * z;
}

/// The mean of points of a curved surface lies below it, by half of its curvature times their mean square along it.
/// Around, a tube's curvature is 1/R; along, in a bend, it is that of the circle that the surface follows there.
double lift_of(const SurfelSpread& spread, const Foot& foot, const Eigen::Vector3d& along,
               const Eigen::Vector3d& inward, double radius_m) {
  const double to_bend = inward.dot(foot.second_m) / foot.derivative_m.squaredNorm();
  const double bent = to_bend / std::max(0.2, 1.0 + radius_m * to_bend);
  return 0.5 * (along_axis(spread, along.cross(inward)) / radius_m + along_axis(spread, along) * bent);
}

/// Where on the line a surfel is; false where it is none of the tube's.
bool place_on(const RecycledVector<SpanPolynomial>& curve, const Surfel& surfel, const SurfelSpread& spread,
              double nearest, double radius_m, SurfacePoint& point) {
  const Eigen::Vector3d point_m = surfel.position_m.cast<double>();
  const Foot foot = foot_on(curve, point_m, nearest);
  point.t = foot.t;
  const Eigen::Vector3d to_axis = foot.position_m - point_m;
  const double distance_m = to_axis.norm();
  if (distance_m < kNearestRadii * radius_m || distance_m > kFarthestRadii * radius_m) return false;
  point.inward = to_axis / distance_m;
  // Beyond an end the foot stays there.
  const Eigen::Vector3d along = foot.derivative_m.normalized();
  if (std::abs(point.inward.dot(along)) > 0.1) return false;
  const Eigen::Vector3d normal = surfel.inward_normal.cast<double>();
  point.facing = point.inward.dot(normal);
  if (point.facing < kLeastFacing || std::abs(along.dot(normal)) > kMostAlong) return false;
  point.lift_m = lift_of(spread, foot, along, point.inward, radius_m);
  point.distance_m = distance_m + point.lift_m;
  return true;
}

}  // namespace

std::vector<SurfacePoint> points_near(const SurfelGrid& grid, std::span<const char> taken, const ScanLine& line,
                                      std::size_t every) {
  const Spline& spline = line.model.spline;
  const double radius_m = line.model.radius_m;
  // A node's own distance and half of that to the next one, which a bend may widen.
  const double reach_m = (kFarthestRadii + 0.5 * kKnotSpacingRadii) * radius_m;
  NodeGrid nodes(spline, reach_m + grid.bucket_radius_m());
  const RecycledVector<SpanPolynomial> curve = polynomials_of(spline);
  std::vector<SurfacePoint> points;
  std::vector<std::uint32_t> near;
  std::vector<std::uint32_t> numbers;
  grid.buckets_in(nodes.box(), numbers);
  for (const std::uint32_t number : numbers) {
    const SurfelBucket& bucket = grid.buckets[number];
    nodes.nodes_near(bucket.center_m, near);
    if (near.empty()) continue;
    const auto first = static_cast<std::uint32_t>((bucket.begin + every - 1) / every * every);
    for (std::uint32_t i = first; i < bucket.end; i += static_cast<std::uint32_t>(every)) {
      if (!taken.empty() && taken[i] != 0) continue;
      const Surfel& surfel = grid.surfels[i];
      const double nearest = nodes.nearest(surfel.position_m.cast<double>(), near, reach_m);
      SurfacePoint point;
      point.surfel = i;
      if (nearest < 0.0 || !place_on(curve, surfel, grid.spread[i], nearest, radius_m, point)) continue;
      points.push_back(point);
      if (!line.closed()) continue;
      const double again = point.t + (point.t < 0.5 * spline.spans() ? line.period : -line.period);
      if (again < 0.0 || again > spline.spans()) continue;
      point.t = again;
      points.push_back(point);
    }
  }
  return points;
}

}  // namespace tubetrack
