#include "vote_side.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace tubetrack {

namespace {

constexpr std::size_t kMostPoints = 20'000;
constexpr std::size_t kFewestPoints = 12;
constexpr int kSteps = 40;               // of a cell each
constexpr double kSmallest_cells = 4.0;  // across; smaller crumbs show noise, not the tube
constexpr double kLeastExcess = 0.02;    // of one side over the other, relative

/// Cells count from −2^20 to 2^20 − 1 around the first point: 21 bits an axis.
std::uint64_t cell_key(const Eigen::Vector3d& offset_cells) {
  std::uint64_t key = 0;
  for (const double coordinate : offset_cells) {
    const double limited = std::clamp(std::floor(coordinate), -1'048'576.0, 1'048'575.0);
    key = (key << 21U) | static_cast<std::uint64_t>(static_cast<std::int64_t>(limited) + 1'048'576);
  }
  return key;
}

/// Sum over the cells of the square of their votes: how many pairs of votes meet.
double meetings(std::span<const OrientedPoint> points, std::size_t stride, double cell_m, double direction) {
  std::vector<std::uint64_t> keys;
  keys.reserve((points.size() / stride + 1) * kSteps);
  const Eigen::Vector3d origin = points.front().position_m;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    const Eigen::Vector3d start = (points[i].position_m - origin) / cell_m;
    for (int step = 1; step <= kSteps; ++step) keys.push_back(cell_key(start + direction * step * points[i].normal));
  }
  std::sort(keys.begin(), keys.end());
  double sum = 0.0;
  for (std::size_t begin = 0, end = 0; begin < keys.size(); begin = end) {
    while (end < keys.size() && keys[end] == keys[begin]) ++end;
    sum += static_cast<double>(end - begin) * static_cast<double>(end - begin);
  }
  return sum;
}

}  // namespace

VoteSide concentrated_side(std::span<const OrientedPoint> points, double spacing_m) {
  if (points.size() < kFewestPoints || !(spacing_m > 0.0)) return VoteSide::undecided;
  // A part of the points is enough, with cells as much larger as those that are left lie farther apart.
  const std::size_t stride = (points.size() + kMostPoints - 1) / kMostPoints;
  const double cell_m = 2.0 * spacing_m * std::sqrt(static_cast<double>(stride));
  Eigen::AlignedBox3d box;
  for (const OrientedPoint& point : points) box.extend(point.position_m);
  if (box.diagonal().norm() < kSmallest_cells * cell_m) return VoteSide::undecided;
  const double along = meetings(points, stride, cell_m, 1.0);
  const double against = meetings(points, stride, cell_m, -1.0);
  const double excess = (along - against) / (along + against);
  if (std::abs(excess) < kLeastExcess) return VoteSide::undecided;
  return excess > 0.0 ? VoteSide::along_normals : VoteSide::against_normals;
}

}  // namespace tubetrack
