#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "grid_surfels.hpp"

namespace tubetrack {

namespace {

constexpr double kSteepest = 3.7;  // tan 75°
constexpr double kLeastPart = 0.5;

struct Window {
  int radius_cells;
  double cell_m;
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
      if (!(std::abs(rise) <= kSteepest * window.cell_m * std::max(1.0, std::hypot(x, y)))) continue;
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

}  // namespace

void add_height_surfels(const HeightGrid& grid, const Surfel& pattern, double radius_m, std::vector<Surfel>& surfels) {
  constexpr int kLargest_cells = 50;
  const int radius_cells =
      static_cast<int>(std::clamp(std::round(radius_m / grid.cell_size_m), 1.0, 1.0 * kLargest_cells));
  const Window window{radius_cells, grid.cell_size_m};
  for (int v = 0; v < grid.height; ++v) {
    for (int u = 0; u < grid.width; ++u) {
      const std::size_t cell =
          static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(u);
      const double height_m = grid.height_m[cell];
      Eigen::Vector2d slope;
      if (std::isnan(height_m) || !fit_plane(grid, u, v, window, slope)) continue;
      Surfel surfel = pattern;
      surfel.position_m = Eigen::Vector3d(u * grid.cell_size_m, v * grid.cell_size_m, -height_m).cast<float>();
      // The surface is z = −height(x, y), seen from below zero: what lies behind it has the larger z.
      const Eigen::Vector3d inward(slope.x(), slope.y(), 1.0);
      surfel.inward_normal = inward.normalized().cast<float>();
      surfel.weight = static_cast<float>(inward.norm());  // a cell's part of a slope is larger than the cell
      surfel.cell = static_cast<std::uint32_t>(cell);
      surfels.push_back(surfel);
    }
  }
}

}  // namespace tubetrack
