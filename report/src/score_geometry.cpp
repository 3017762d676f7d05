#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "tubetrack/report/score.hpp"

namespace tubetrack {

LineFoot foot_on_line(const Eigen::Vector3d& point, std::span<const Eigen::Vector3d> line) {
  LineFoot best;
  best.distance_m = std::numeric_limits<double>::infinity();
  best.beyond_end = true;
  if (line.size() == 1) {
    best.distance_m = (point - line[0]).norm();
    best.point_m = line[0];
  }
  double passed_m = 0.0;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Eigen::Vector3d way = line[i + 1] - line[i];
    const double squared = way.squaredNorm();
    const double start_m = std::exchange(passed_m, passed_m + std::sqrt(squared));
    const double along = squared > 0.0 ? (point - line[i]).dot(way) / squared : 0.0;
    const Eigen::Vector3d nearest = line[i] + std::clamp(along, 0.0, 1.0) * way;
    const double distance_m = (point - nearest).norm();
    if (distance_m >= best.distance_m) continue;
    const bool before_start = i == 0 && along < 0.0;
    const bool past_end = i + 2 == line.size() && along > 1.0;
    best = {distance_m, before_start || past_end, nearest, squared > 0.0 ? way.normalized() : best.along,
            start_m + (nearest - line[i]).norm()};
  }
  return best;
}

LineSamples resample(std::span<const Eigen::Vector3d> line, double step_m) {
  double length_m = 0.0;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) length_m += (line[i + 1] - line[i]).norm();
  LineSamples samples;
  if (!(length_m > 0.0) || !std::isfinite(length_m)) return samples;
  const auto pieces = static_cast<std::size_t>(std::ceil(length_m / step_m - 1e-9));
  samples.piece_m = length_m / static_cast<double>(pieces);
  double passed_m = 0.0;
  for (std::size_t i = 0; i + 1 < line.size() && samples.points.size() < pieces; ++i) {
    const Eigen::Vector3d way = line[i + 1] - line[i];
    const double part_m = way.norm();
    for (;;) {
      const double wanted_m = (static_cast<double>(samples.points.size()) + 0.5) * samples.piece_m;
      if (samples.points.size() == pieces || wanted_m > passed_m + part_m) break;
      samples.points.emplace_back(line[i] + way * ((wanted_m - passed_m) / part_m));
    }
    passed_m += part_m;
  }
  return samples;
}

// The Hungarian method with potentials (Kuhn–Munkres, O(n³)) on the square matrix padded with zeros; costs are −gain.
std::vector<int> best_assignment(const std::vector<double>& gain, int rows, int cols) {
  const int n = std::max(rows, cols);
  const auto cost = [&](int r, int c) {
    return r < rows && c < cols
               ? -gain[static_cast<std::size_t>(r) * static_cast<std::size_t>(cols) + static_cast<std::size_t>(c)]
               : 0.0;
  };
  const auto size = static_cast<std::size_t>(n) + 1;
  std::vector<double> row_potential(size, 0.0), col_potential(size, 0.0);
  std::vector<std::size_t> row_of(size, 0), way(size, 0);  // 1-based, 0: none
  for (std::size_t row = 1; row < size; ++row) {
    row_of[0] = row;
    std::size_t col = 0;
    std::vector<double> slack(size, std::numeric_limits<double>::infinity());
    std::vector<bool> used(size, false);
    do {
      used[col] = true;
      double least = std::numeric_limits<double>::infinity();
      std::size_t next = 0;
      for (std::size_t c = 1; c < size; ++c) {
        if (used[c]) continue;
        const double reduced = cost(static_cast<int>(row_of[col]) - 1, static_cast<int>(c) - 1) -
                               row_potential[row_of[col]] - col_potential[c];
        if (reduced < slack[c]) {
          slack[c] = reduced;
          way[c] = col;
        }
        if (slack[c] < least) {
          least = slack[c];
          next = c;
        }
      }
      for (std::size_t c = 0; c < size; ++c) {
        if (used[c]) {
          row_potential[row_of[c]] += least;
          col_potential[c] -= least;
        } else {
          slack[c] -= least;
        }
      }
      col = next;
    } while (row_of[col] != 0);
    for (; col != 0; col = way[col]) row_of[col] = row_of[way[col]];
  }
  std::vector<int> col_of(static_cast<std::size_t>(rows), -1);
  for (std::size_t c = 1; c <= static_cast<std::size_t>(cols); ++c) {
    const int row = static_cast<int>(row_of[c]) - 1;
    if (row >= 0 && row < rows && cost(row, static_cast<int>(c) - 1) < 0.0) {
      col_of[static_cast<std::size_t>(row)] = static_cast<int>(c) - 1;
    }
  }
  return col_of;
}

}  // namespace tubetrack
