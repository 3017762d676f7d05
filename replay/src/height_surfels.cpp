#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "grid_surfels.hpp"
#include "voronoi_normals.hpp"

namespace tubetrack {

namespace {

constexpr double kSteepest = 3.7;  // tan 75°
constexpr double kLeastPart = 0.5;

struct Window {
  int radius_cells = 1;
  double cell_m = 0.0;
};

/// Slopes (along columns, along rows) of the least-squares plane around a cell, or false where too few cells belong to
/// its surface.
bool fit_plane(const HeightGrid& grid, int u, int v, const Window& window, Eigen::Vector2d& slope) {
  const auto width = static_cast<std::size_t>(grid.width);
  const double own = grid.height_m[static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u)];
  Eigen::Matrix3d normal_matrix = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
  int count = 0, possible = 0;
  const int r = window.radius_cells;
  for (int y = -r; y <= r; ++y) {
    for (int x = -r; x <= r; ++x) {
      ++possible;
      if (v + y < 0 || v + y >= grid.height || u + x < 0 || u + x >= grid.width) continue;
      const double other = grid.height_m[static_cast<std::size_t>(v + y) * width + static_cast<std::size_t>(u + x)];
      const double rise = other - own;
      // False for NaN too.
      if (!(std::abs(rise) <= kSteepest * window.cell_m * std::max(1.0, std::sqrt(1.0 * (x * x + y * y))))) continue;
      const Eigen::Vector3d row(x, y, 1.0);
      normal_matrix += row * row.transpose();
      right_side += row * (rise / window.cell_m);
      ++count;
    }
  }
  if (count < kLeastPart * possible) return false;
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal_matrix);
  if (solver.info() != Eigen::Success || solver.rcond() < 1e-6) return false;
  slope = solver.solve(right_side).head<2>();
  return slope.allFinite();
}

ScanSurfel surfel_at(const HeightGrid& grid, int u, int v, const Eigen::Vector3d& inward) {
  ScanSurfel surfel;
  const std::size_t cell =
      static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(u);
  const double height_m = grid.height_m[cell];
  surfel.position_m = Eigen::Vector3d(u * grid.cell_size_m, v * grid.cell_size_m, -height_m).cast<float>();
  surfel.inward_normal = inward.normalized().cast<float>();
  // A cell's part of a slope is larger than the cell.
  surfel.weight = static_cast<float>(inward.norm() / inward.z());
  return surfel;
}

void add_by_voronoi(const HeightGrid& grid, double radius_m, std::vector<ScanSurfel>& surfels) {
  std::vector<Eigen::Vector3d> points_m;
  std::vector<Eigen::Vector2i> cells;
  for (int v = 0; v < grid.height; ++v) {
    for (int u = 0; u < grid.width; ++u) {
      const double height_m = grid.height_m[static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) +
                                            static_cast<std::size_t>(u)];
      if (std::isnan(height_m)) continue;
      points_m.emplace_back(u * grid.cell_size_m, v * grid.cell_size_m, -height_m);
      cells.emplace_back(u, v);
    }
  }
  const std::vector<Eigen::Vector3d> towards_viewer(points_m.size(), -Eigen::Vector3d::UnitZ());
  const std::vector<Eigen::Vector3f> normals = voronoi_normals(
      points_m, towards_viewer, {grid.cell_size_m, kVoronoiOffset * radius_m, kVoronoiRadius * radius_m});
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Eigen::Vector3d inward = -normals[i].cast<double>();
    if (inward.z() * kSteepest < inward.head<2>().norm()) continue;
    surfels.push_back(surfel_at(grid, cells[i].x(), cells[i].y(), inward));
  }
}

/// Sums along a row over ± r cells, for each cell that has as many to both sides; the others stay as they are.
struct RowSums {
  std::vector<double> heights, moments;  ///< of heights, and of heights times how far along they are
  std::vector<int> breaks;               ///< steps that are steep, or to nothing
};

/// Slopes along columns and rows of one row of windows; where `breaks` is not 0, fit_plane has to look at each
/// neighbour.
struct SlopeRow {
  std::vector<double> along, across;
  std::vector<int> breaks;
};

/// Windows in which all heights hang together have sums for a plane: `slope_row` gets the slopes of one row of them.
/// Neighbours that rise by less than `steep_m` a step along either axis rise by less than √2 times that a step in any
/// direction.
class PlaneSums {
 public:
  PlaneSums(const HeightGrid& grid, const Window& window) : grid_(grid), r_(window.radius_cells) {
    steep_m_ = static_cast<float>(kSteepest * window.cell_m / std::sqrt(2.0));
    const int side = 2 * r_ + 1;
    rows_.resize(static_cast<std::size_t>(side));
    double squares = 0.0;
    for (int x = 1; x <= r_; ++x) squares += 2.0 * x * x;
    per_slope_ = 1.0 / (window.cell_m * squares * side);
    for (int v = 0; v < std::min(side - 1, grid.height); ++v) sum_row(v);
  }

  /// Of rows in order, from the first.
  void slope_row(int v, SlopeRow& slopes) {
    const auto width = static_cast<std::size_t>(grid_.width);
    slopes.along.assign(width, 0.0);
    slopes.across.assign(width, 0.0);
    if (v + r_ < grid_.height) sum_row(v + r_);
    const bool whole = v >= r_ && v + r_ < grid_.height;
    slopes.breaks.assign(width, whole ? 0 : 1);
    if (!whole) return;
    // Row by row, in loops so plain that compilers make vectors of them.
    double* const along = slopes.along.data();
    double* const across = slopes.across.data();
    int* const breaks = slopes.breaks.data();
    for (int y = -r_; y <= r_; ++y) {
      const RowSums& row = rows_[static_cast<std::size_t>(v + y) % rows_.size()];
      const double up = per_slope_ * y;
      for (std::size_t u = 0; u < width; ++u) breaks[u] |= row.breaks[u];
      for (std::size_t u = 0; u < width; ++u) along[u] += per_slope_ * row.moments[u];
      for (std::size_t u = 0; u < width; ++u) across[u] += up * row.heights[u];
    }
  }

 private:
  void sum_row(int v) {
    const auto width = static_cast<std::size_t>(grid_.width);
    const float* own = grid_.height_m.data() + static_cast<std::size_t>(v) * width;
    const float* before = v > 0 ? own - width : own;
    RowSums& row = rows_[static_cast<std::size_t>(v) % rows_.size()];
    row.heights.assign(width, 0.0);
    row.moments.assign(width, 0.0);
    row.breaks.assign(width, 1);
    if (grid_.width <= 2 * r_) return;
    breaks_.assign(width, 0);
    // False for NaN too.
    for (std::size_t u = 0; u < width; ++u) breaks_[u] = std::abs(own[u] - before[u]) <= steep_m_ ? 0 : 1;
    for (std::size_t u = 1; u < width; ++u) breaks_[u] += std::abs(own[u] - own[u - 1]) <= steep_m_ ? 0 : 1;
    const auto inner = static_cast<std::size_t>(grid_.width - 2 * r_), r = static_cast<std::size_t>(r_);
    for (std::size_t i = 0; i < inner; ++i) row.breaks[r + i] = breaks_[i];
    for (std::size_t i = 0; i < inner; ++i) row.heights[r + i] = static_cast<double>(own[i]);
    for (std::size_t i = 0; i < inner; ++i) row.moments[r + i] = -static_cast<double>(r_) * static_cast<double>(own[i]);
    for (std::size_t x = 1; x <= 2 * r; ++x) {
      const double away = static_cast<double>(x) - r_;
      for (std::size_t i = 0; i < inner; ++i) row.breaks[r + i] += breaks_[i + x];
      for (std::size_t i = 0; i < inner; ++i) row.heights[r + i] += static_cast<double>(own[i + x]);
      for (std::size_t i = 0; i < inner; ++i) row.moments[r + i] += away * static_cast<double>(own[i + x]);
    }
  }

  const HeightGrid& grid_;
  int r_;
  float steep_m_ = 0.0F;
  double per_slope_ = 0.0;
  std::vector<RowSums> rows_;  // row v at v modulo their number
  std::vector<int> breaks_;
};

}  // namespace

void add_height_surfels(const HeightGrid& grid, const NormalWindow& normal_window, std::vector<ScanSurfel>& surfels) {
  if (normal_window.method == GridNormals::voronoi) {
    add_by_voronoi(grid, normal_window.radius_m, surfels);
    return;
  }
  constexpr int kLargest_cells = 50;
  const int radius_cells =
      static_cast<int>(std::clamp(std::round(normal_window.radius_m / grid.cell_size_m), 1.0, 1.0 * kLargest_cells));
  const Window window{radius_cells, grid.cell_size_m};
  PlaneSums sums(grid, window);
  SlopeRow slopes;
  surfels.reserve(grid.height_m.size());
  for (int v = 0; v < grid.height; ++v) {
    sums.slope_row(v, slopes);
    for (int u = 0; u < grid.width; ++u) {
      const std::size_t cell =
          static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(u);
      if (std::isnan(grid.height_m[cell])) continue;
      const auto at = static_cast<std::size_t>(u);
      Eigen::Vector2d slope(slopes.along[at], slopes.across[at]);
      if (slopes.breaks[at] != 0 && !fit_plane(grid, u, v, window, slope)) continue;
      // The surface is z = −height(x, y), seen from below zero: what lies behind it has the larger z.
      surfels.push_back(surfel_at(grid, u, v, Eigen::Vector3d(slope.x(), slope.y(), 1.0)));
    }
  }
}

}  // namespace tubetrack
