#include "normal_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <numbers>
#include <vector>

#include "markdown.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack::bench {

namespace {

constexpr double kBend_mm = 60.0, kRadius_mm = 12.0;

/// Surfels whose true normal leans more than this from the viewer are not counted: a height map shows little there.
constexpr double kSteepest_deg = 60.0;

Eigen::Vector3d torus_normal(const Eigen::Vector3d& at_mm) {
  const Eigen::Vector3d on_axis_mm = kBend_mm * Eigen::Vector3d(at_mm.x(), at_mm.y(), 0.0).normalized();
  return (at_mm - on_axis_mm).normalized();
}

/// Voxels whose centres are inside, around the origin.
Scan torus_voxels(double step_mm) {
  Scan scan;
  scan.kind = ScanKind::voxels;
  VoxelGrid& grid = scan.voxels;
  const int half_xy = static_cast<int>((kBend_mm + kRadius_mm) / step_mm) + 2,
            half_z = static_cast<int>(kRadius_mm / step_mm) + 2;
  grid.size = {2 * half_xy, 2 * half_xy, 2 * half_z};
  grid.axes_m = 1e-3 * step_mm * Eigen::Matrix3d::Identity();
  grid.origin_m = -1e-3 * step_mm * Eigen::Vector3d(half_xy - 0.5, half_xy - 0.5, half_z - 0.5);
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      for (int i = 0; i < grid.size.x(); ++i) {
        const Eigen::Vector3d at_mm = 1e3 * (grid.origin_m + grid.axes_m * Eigen::Vector3d(i, j, k));
        const double out_mm = std::hypot(at_mm.x(), at_mm.y()) - kBend_mm;
        grid.inside.push_back(std::hypot(out_mm, at_mm.z()) <= kRadius_mm ? 1 : 0);
      }
    }
  }
  scan.grid_step_m = 1e-3 * step_mm;
  return scan;
}

/// The upper half, each height rounded to a tenth of the step.
Scan torus_heights(double step_mm) {
  Scan scan;
  scan.kind = ScanKind::height_map;
  HeightGrid& grid = scan.heights;
  const int half = static_cast<int>((kBend_mm + kRadius_mm) / step_mm) + 2;
  grid.width = grid.height = 2 * half;
  grid.cell_size_m = scan.grid_step_m = 1e-3 * step_mm;
  scan.origin_m = -1e-3 * step_mm * Eigen::Vector3d(half - 0.5, half - 0.5, 0.0);
  for (int v = 0; v < grid.height; ++v) {
    for (int u = 0; u < grid.width; ++u) {
      const double out_mm = step_mm * std::hypot(u - half + 0.5, v - half + 0.5) - kBend_mm;
      const double squared = kRadius_mm * kRadius_mm - out_mm * out_mm;
      const double height_mm = 0.1 * step_mm * std::round(std::sqrt(std::max(0.0, squared)) / (0.1 * step_mm));
      grid.height_m.push_back(squared > 0.0 ? static_cast<float>(1e-3 * height_mm)
                                            : std::numeric_limits<float>::quiet_NaN());
    }
  }
  return scan;
}

struct NormalErrors {
  double mean_deg = 0.0, worst_deg = 0.0, us_a_surfel = 0.0;
};

NormalErrors errors_of(const Scan& scan, const ScanSurfelOptions& options) {
  const std::clock_t begin = std::clock();
  const std::vector<ScanSurfel> surfels = surfels_of(scan, options);
  NormalErrors errors;
  errors.us_a_surfel = 1e6 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC /
                       std::max(1.0, static_cast<double>(surfels.size()));
  double count = 0.0;
  for (const ScanSurfel& surfel : surfels) {
    const Eigen::Vector3d normal = torus_normal(1e3 * (surfel.position_m.cast<double>() + scan.origin_m));
    if (scan.kind == ScanKind::height_map && -normal.z() < std::cos(kSteepest_deg * std::numbers::pi / 180.0)) continue;
    const double cosine = std::clamp(-surfel.inward_normal.cast<double>().dot(normal), -1.0, 1.0);
    const double deg = std::acos(cosine) * 180.0 / std::numbers::pi;
    errors.mean_deg += deg;
    errors.worst_deg = std::max(errors.worst_deg, deg);
    count += 1.0;
  }
  errors.mean_deg /= std::max(1.0, count);
  return errors;
}

}  // namespace

std::string normal_table_text() {
  struct Estimator {
    const char* name;
    GridNormals method;
    double steps;
  };
  const Estimator of_voxels[] = {{"voxels: smoothed, ball of 4", GridNormals::smoothed, 4.0},
                                 {"voxels: smoothed, ball of 6", GridNormals::smoothed, 6.0},
                                 {"voxels: Voronoi, R = r = 6 (`--normals vcm`)", GridNormals::voronoi, 4.0},
                                 {"voxels: Voronoi, R = r = 9", GridNormals::voronoi, 6.0}};
  const Estimator of_heights[] = {{"height map: planes over ±3", GridNormals::smoothed, 3.0},
                                  {"height map: Voronoi, R = r = 4.5 (`--normals vcm`)", GridNormals::voronoi, 3.0}};
  const double steps_mm[] = {3.0, 2.0, 1.0, 0.5};
  MarkdownTable table({"normals", "3 mm", "2 mm", "1 mm", "0.5 mm", "µs a surfel"});
  const auto add = [&](const Estimator& estimator, bool heights) {
    std::vector<std::string> cells{estimator.name};
    double us = 0.0;
    for (const double step_mm : steps_mm) {
      ScanSurfelOptions options;
      options.normals = estimator.method;
      options.normal_radius_m = 1e-3 * step_mm * estimator.steps;
      const NormalErrors errors = errors_of(heights ? torus_heights(step_mm) : torus_voxels(step_mm), options);
      cells.push_back(fmt::format("{:.2f}° ({:.1f}°)", errors.mean_deg, errors.worst_deg));
      us = errors.us_a_surfel;
    }
    cells.push_back(number(us, 1));
    table.add(cells);
  };
  for (const Estimator& estimator : of_voxels) add(estimator, false);
  for (const Estimator& estimator : of_heights) add(estimator, true);
  return table.text();
}

}  // namespace tubetrack::bench
