#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "scan_fit.hpp"
#include "scan_place.hpp"
#include "tubetrack/tracker/packed_cell.hpp"

namespace tubetrack {

namespace {

constexpr int kNodesPerSpan = 2;
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
    if (const std::uint64_t cell = packed_cell(point_m, cell_m_); cell != last_cell_) gather(cell);
    for (const std::uint32_t node : around_) {
      if ((nodes_m_[node] - point_m).squaredNorm() < cell_m_ * cell_m_) near.push_back(node);
    }
  }

  const Eigen::Vector3d& node_m(std::uint32_t node) const { return nodes_m_[node]; }

 private:
  /// The nodes of the cell and of those around it, three in a row at a time. At the outermost cells, a million away,
  /// some of those are elsewhere; what is too far is left out in any case.
  void gather(std::uint64_t cell) {
    last_cell_ = cell;
    around_.clear();
    for (int row = 0; row < 9; ++row) {
      const std::uint64_t key = cell + (static_cast<std::uint64_t>(row % 3) << 21) - (std::uint64_t{1} << 21) +
                                (static_cast<std::uint64_t>(row / 3) << 42) - (std::uint64_t{1} << 42);
      auto at = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(key - 1, std::uint32_t{0}));
      for (; at != sorted_.end() && at->first <= key + 1; ++at) around_.push_back(at->second);
    }
  }

  double cell_m_;
  std::vector<Eigen::Vector3d> nodes_m_;
  Eigen::AlignedBox3d box_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> sorted_;  // cell and node
  std::uint64_t last_cell_ = ~std::uint64_t{0};
  std::vector<std::uint32_t> around_;
};

/// Surfels near a line, placed on it by the batch.
class PlacedPoints {
 public:
  PlacedPoints(const SurfelGrid& grid, const ScanLine& line)
      : surfels_(grid.surfels),
        radius_m_(line.model.radius_m),
        period_(line.closed() ? line.period : 0.0),
        line_(line_spans_of(line.model.spline)) {}

  /// `t`: about where on the line it is.
  void add(std::int32_t surfel, double t) {
    const auto span = std::min(static_cast<std::int32_t>(t), static_cast<std::int32_t>(line_.size()) - 1);
    batch_.surfel[count_] = surfel;
    batch_.span[count_] = span;
    batch_.s[count_] = static_cast<float>(t - span);
    if (++count_ == PlaceBatch::kSize) place();
  }
  void expect(std::size_t most) { points_.reserve(most); }
  std::vector<SurfacePoint> take() {
    place();
    return std::move(points_);
  }

 private:
  void place() {
    place_surfels(line_, radius_m_, surfels_, count_, batch_);
    const auto spans = static_cast<double>(line_.size());
    for (std::size_t i = 0; i < count_; ++i) {
      if (batch_.belongs[i] == 0) continue;
      const double t = batch_.span[i] + static_cast<double>(batch_.s[i]);
      points_.push_back({t,
                         static_cast<std::uint32_t>(batch_.surfel[i]),
                         batch_.lift_m[i],
                         batch_.distance_m[i],
                         {batch_.x[i], batch_.y[i], batch_.z[i]}});
      if (!(period_ > 0.0)) continue;
      const double again = t + (t < 0.5 * spans ? period_ : -period_);
      if (again < 0.0 || again > spans) continue;
      points_.push_back(points_.back());
      points_.back().t = again;
    }
    count_ = 0;
  }

  std::span<const CellSurfel> surfels_;
  double radius_m_, period_;
  std::vector<LineSpan> line_;
  PlaceBatch batch_;
  std::size_t count_ = 0;
  std::vector<SurfacePoint> points_;
};

std::array<float, 3> floats(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

}  // namespace

std::vector<SurfacePoint> points_near(const SurfelGrid& grid, std::span<const char> taken, const ScanLine& line,
                                      std::size_t every) {
  // The nearest node is a quarter of a span from a surfel's foot, or a little more where spans differ.
  constexpr double kToNodeSpans = 0.35;
  const double reach_m = (kFarthestRadii + kToNodeSpans * kKnotSpacingRadii) * line.model.radius_m;
  NodeGrid nodes(line.model.spline, reach_m + grid.bucket_radius_m());
  PlacedPoints placed(grid, line);
  NearestBatch batch;
  std::vector<std::uint32_t> near, numbers;
  std::vector<std::array<float, 3>> near_m;
  grid.buckets_in(nodes.box(), numbers);
  std::size_t most = 0;
  for (const std::uint32_t number : numbers) most += grid.buckets[number].end - grid.buckets[number].begin;
  placed.expect(most / every);
  for (const std::uint32_t number : numbers) {
    const SurfelBucket& bucket = grid.buckets[number];
    nodes.nodes_near(bucket.center_m, near);
    if (near.empty()) continue;
    std::size_t count = 0;
    const auto first = static_cast<std::uint32_t>((bucket.begin + every - 1) / every * every);
    for (std::uint32_t i = first; i < bucket.end; i += static_cast<std::uint32_t>(every)) {
      if (taken.empty() || taken[i] == 0) batch.surfel[count++] = static_cast<std::int32_t>(i);
    }
    near_m.clear();
    for (const std::uint32_t node : near) near_m.push_back(floats(nodes.node_m(node) - bucket.center_m));
    nearest_nodes(near_m, floats(bucket.center_m), grid.surfels, count, batch);
    for (std::size_t i = 0; i < count; ++i) {
      if (static_cast<double>(batch.squared_m2[i]) < reach_m * reach_m)
        placed.add(batch.surfel[i],
                   static_cast<double>(near[static_cast<std::size_t>(batch.nearest[i])]) / kNodesPerSpan);
    }
  }
  return placed.take();
}

void place_again(const SurfelGrid& grid, const ScanLine& line, std::vector<SurfacePoint>& points) {
  PlacedPoints placed(grid, line);
  placed.expect(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Where a closed line overlaps itself a surfel is there twice, and is once more when it is placed.
    if (i > 0 && points[i].surfel == points[i - 1].surfel) continue;
    placed.add(static_cast<std::int32_t>(points[i].surfel), std::max(0.0, points[i].t));
  }
  points = placed.take();
}

}  // namespace tubetrack
