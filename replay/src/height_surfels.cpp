#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "grid_surfels.hpp"
#include "voronoi_normals.hpp"

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

Surfel surfel_at(const HeightGrid& grid, int u, int v, const Eigen::Vector3d& inward, const Surfel& pattern) {
  Surfel surfel = pattern;
  const std::size_t cell =
      static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(u);
  const double height_m = grid.height_m[cell];
  surfel.position_m = Eigen::Vector3d(u * grid.cell_size_m, v * grid.cell_size_m, -height_m).cast<float>();
  surfel.inward_normal = inward.normalized().cast<float>();
  // A cell's part of a slope is larger than the cell.
  surfel.weight = static_cast<float>(inward.norm() / inward.z());
  surfel.cell = static_cast<std::uint32_t>(cell);
  return surfel;
}

void add_by_voronoi(const HeightGrid& grid, const Surfel& pattern, double radius_m, std::vector<Surfel>& surfels) {
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
    surfels.push_back(surfel_at(grid, cells[i].x(), cells[i].y(), inward, pattern));
  }
}

}  // namespace

void add_height_surfels(const HeightGrid& grid, const Surfel& pattern, const NormalWindow& normal_window,
                        std::vector<Surfel>& surfels) {
  if (normal_window.method == GridNormals::voronoi) {
    add_by_voronoi(grid, pattern, normal_window.radius_m, surfels);
    return;
  }
  constexpr int kLargest_cells = 50;
  const int radius_cells =
      static_cast<int>(std::clamp(std::round(normal_window.radius_m / grid.cell_size_m), 1.0, 1.0 * kLargest_cells));
  const Window window{radius_cells, grid.cell_size_m};
  for (int v = 0; v < grid.height; ++v) {
    for (int u = 0; u < grid.width; ++u) {
      const std::size_t cell =
          static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(u);
      Eigen::Vector2d slope;
      if (std::isnan(grid.height_m[cell]) || !fit_plane(grid, u, v, window, slope)) continue;
      // The surface is z = −height(x, y), seen from below zero: what lies behind it has the larger z.
      surfels.push_back(surfel_at(grid, u, v, Eigen::Vector3d(slope.x(), slope.y(), 1.0), pattern));
    }
  }
}

}  // namespace tubetrack
