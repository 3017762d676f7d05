#include "tubetrack/heightmap/plane_map.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace tubetrack {

namespace {

constexpr int kMostCells = 4096;
constexpr int kGrowBy = 64;
constexpr int kMostTrust = 10;
constexpr double kEdgeSigmas = 6.0;  // between neighbours: a depth edge
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

/// Cells from begin to below end, either way.
struct CellRange {
  int col_begin = 0, col_end = 0, row_begin = 0, row_end = 0;
};

/// A reading over the plane.
struct Reading {
  int col = 0, row = 0;
  float height_m = 0.0F;
  float sigma_m = 0.0F;  ///< of the height
};

/// Beside a depth edge a reading may be a mixture of what lies on either side.
bool beside_edge(const HeightMap& frame, int u, int v, double sigma_m) {
  const float depth_m = frame.depth_m[frame.cell(u, v)];
  const auto jumps = [&](int other_u, int other_v) {
    if (other_u < 0 || other_v < 0 || other_u >= frame.intrinsics.width || other_v >= frame.intrinsics.height)
      return false;
    const float other_m = frame.depth_m[frame.cell(other_u, other_v)];
    return other_m <= 0.0F || std::abs(other_m - depth_m) > kEdgeSigmas * sigma_m;
  };
  return jumps(u - 1, v) || jumps(u + 1, v) || jumps(u, v - 1) || jumps(u, v + 1);
}

/// The plane normal · p = 1 (camera frame) through the readings around a pixel that are on its side of depth edges.
/// Empty where too few are.
std::optional<Eigen::Vector3d> plane_around(const HeightMap& frame, int u, int v, double sigma_m) {
  constexpr int kHalf_px = 2;
  const float own_m = frame.depth_m[frame.cell(u, v)];
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int count = 0;
  const Eigen::Vector2f& middle = frame.rays[frame.cell(u, v)];
  for (int row = std::max(0, v - kHalf_px); row <= std::min(frame.intrinsics.height - 1, v + kHalf_px); ++row) {
    for (int col = std::max(0, u - kHalf_px); col <= std::min(frame.intrinsics.width - 1, u + kHalf_px); ++col) {
      const std::size_t cell = frame.cell(col, row);
      const float depth_m = frame.depth_m[cell];
      if (depth_m <= 0.0F || std::abs(depth_m - own_m) > kEdgeSigmas * sigma_m) continue;
      const Eigen::Vector2d way = (frame.rays[cell] - middle).cast<double>() * frame.intrinsics.fx_px;
      const Eigen::Vector3d at(way.x(), way.y(), 1.0);
      matrix += at * at.transpose();
      right += at / depth_m;
      ++count;
    }
  }
  const int side = 2 * kHalf_px + 1;
  if (2 * count < side * side) return std::nullopt;
  const Eigen::Vector3d w = matrix.ldlt().solve(right);
  if (!w.allFinite()) return std::nullopt;
  const double a = w.x() * frame.intrinsics.fx_px, b = w.y() * frame.intrinsics.fx_px;
  return Eigen::Vector3d(a, b, w.z() - a * middle.x() - b * middle.y());
}

/// A reading over the plane that has been put on its surface.
struct OnSurface {
  Eigen::Vector3d point_m;    ///< over the plane
  Eigen::Vector2d rise;       ///< of the heights, per metre along the plane's axes
  double height_per_m = 0.0;  ///< what the height changes by for a change of the depth
};

/// Moves a reading to where its ray meets the surface that the readings around it show, and by its height above that.
/// Where its own noise carried it is no place for it: on a flank that faces away more readings come from the side that
/// is seen better than go there, so that a mean by place lies too low, by 2 mm at the silhouette of a tube of 20 mm.
/// Empty where no surface is seen, or one that no height tells.
std::optional<OnSurface> put_on_surface(const Eigen::Isometry3d& plane_from_camera, const Eigen::Vector3d& surface,
                                        const Eigen::Vector3d& ray, double depth_m) {
  constexpr double kSteepest = 0.25;  // cosine of 75°
  constexpr double kGrazing = 0.42;   // of 65°: beyond, jitter across the silhouette puts readings too far away
  const Eigen::Vector3d normal = plane_from_camera.linear() * surface;
  const double along = surface.dot(ray);
  if (along < kGrazing * surface.norm() * ray.norm() || normal.z() < kSteepest * normal.norm()) return std::nullopt;
  const Eigen::Vector3d met = plane_from_camera * (ray / along);
  const double behind_m = depth_m - 1.0 / along;
  const double height_per_m = along / normal.z();
  return OnSurface{{met.x(), met.y(), met.z() + behind_m * height_per_m}, normal.head<2>() / normal.z(), height_per_m};
}

std::vector<Reading> readings_of(const PlaneMap& map, const HeightMap& frame, const NoiseModel& noise,
                                 const Eigen::Isometry3d& world_from_camera) {
  const Eigen::Isometry3d plane_from_camera = map.world_from_plane.inverse() * world_from_camera;
  const DisparityLevels levels = levels_of_readings(frame, noise);
  std::vector<Reading> readings;
  for (std::size_t cell = 0; cell < frame.depth_m.size(); ++cell) {
    if (frame.depth_m[cell] <= 0.0F) continue;
    const double sigma_m = axial_sigma_m(noise, frame.depth_m[cell], 0.0);
    const auto width = static_cast<std::size_t>(frame.intrinsics.width);
    const int u = static_cast<int>(cell % width), v = static_cast<int>(cell / width);
    if (beside_edge(frame, u, v, sigma_m)) continue;
    const double depth_m = depth_of_level_m(levels, frame.depth_m[cell]);
    const Eigen::Vector3d ray(frame.rays[cell].x(), frame.rays[cell].y(), 1.0);
    const auto surface = plane_around(frame, u, v, sigma_m);
    const auto placed =
        surface ? put_on_surface(plane_from_camera, *surface, ray, depth_m) : std::optional<OnSurface>();
    if (!placed) continue;
    const double height_m = -placed->point_m.z();
    if (!(height_m >= kLowest_m && height_m <= kHighest_m)) continue;
    const double col = std::floor(placed->point_m.x() / map.cell_m), row = std::floor(placed->point_m.y() / map.cell_m);
    if (std::abs(col) >= kMostCells || std::abs(row) >= kMostCells) continue;
    // To the cell's middle, along the surface: of the last cell of a flank only the part that is seen has readings.
    const Eigen::Vector2d to_middle_m = map.cell_m * Eigen::Vector2d(col + 0.5, row + 0.5) - placed->point_m.head<2>();
    readings.push_back({static_cast<int>(col), static_cast<int>(row),
                        static_cast<float>(height_m + placed->rise.dot(to_middle_m)),
                        static_cast<float>(sigma_m * placed->height_per_m)});
  }
  return readings;
}

/// Makes room for all readings, in steps; what would make the map too large stays outside.
void grow(PlaneMap& map, const std::vector<Reading>& readings) {
  const bool empty = map.width == 0;
  CellRange now{map.first_col, map.first_col + map.width, map.first_row, map.first_row + map.height};
  CellRange all = now;
  if (empty) all = {readings[0].col, readings[0].col + 1, readings[0].row, readings[0].row + 1};
  for (const Reading& reading : readings) {
    all.col_begin = std::min(all.col_begin, reading.col), all.col_end = std::max(all.col_end, reading.col + 1);
    all.row_begin = std::min(all.row_begin, reading.row), all.row_end = std::max(all.row_end, reading.row + 1);
  }
  const auto widened = [](int& begin, int& end) {
    begin = static_cast<int>(std::floor(1.0 * begin / kGrowBy)) * kGrowBy;
    end = std::min(static_cast<int>(std::ceil(1.0 * end / kGrowBy)) * kGrowBy, begin + kMostCells);
  };
  widened(all.col_begin, all.col_end);
  widened(all.row_begin, all.row_end);
  if (!empty) {
    // A map that is full keeps what it has.
    if (now.col_end > all.col_end) all.col_begin = now.col_begin, all.col_end = now.col_end;
    if (now.row_end > all.row_end) all.row_begin = now.row_begin, all.row_end = now.row_end;
  }
  PlaneMap grown{map.world_from_plane,
                 map.cell_m,
                 all.col_begin,
                 all.row_begin,
                 all.col_end - all.col_begin,
                 all.row_end - all.row_begin,
                 {},
                 {},
                 {}};
  if (!empty && grown.width == map.width && grown.height == map.height && grown.first_col == map.first_col &&
      grown.first_row == map.first_row)
    return;
  const auto size = static_cast<std::size_t>(grown.width) * static_cast<std::size_t>(grown.height);
  grown.height_m.assign(size, kNone);
  grown.count.assign(size, 0);
  grown.trust.assign(size, 0);
  for (int row = 0; row < map.height; ++row) {
    const auto from = static_cast<std::ptrdiff_t>(row) * map.width;
    const auto to = static_cast<std::ptrdiff_t>(row + map.first_row - grown.first_row) * grown.width +
                    (map.first_col - grown.first_col);
    std::copy_n(map.height_m.begin() + from, map.width, grown.height_m.begin() + to);
    std::copy_n(map.count.begin() + from, map.width, grown.count.begin() + to);
    std::copy_n(map.trust.begin() + from, map.width, grown.trust.begin() + to);
  }
  map = std::move(grown);
}

/// What a frame says of one cell.
struct FrameCell {
  float top_m = kNone;
  float sum_m = 0.0F, sigma_m = 0.0F;
  int count = 0;
};

void vote(PlaneMap& map, std::size_t cell, float height_m, float sigma_m) {
  const float now_m = map.height_m[cell];
  const bool agrees =
      map.trust[cell] > 0 && std::abs(height_m - now_m) < 4.0F * sigma_m + static_cast<float>(map.cell_m);
  if (agrees) {
    map.count[cell] = static_cast<std::uint16_t>(std::min<int>(map.count[cell] + 1, 60000));
    map.height_m[cell] = now_m + (height_m - now_m) / static_cast<float>(map.count[cell]);
    map.trust[cell] = static_cast<std::uint8_t>(std::min<int>(map.trust[cell] + 1, kMostTrust));
    return;
  }
  if (map.trust[cell] > 1) {
    --map.trust[cell];
    return;
  }
  map.height_m[cell] = height_m;
  map.count[cell] = map.trust[cell] = 1;
}

}  // namespace

PlaneMap make_plane_map(const SupportPlane& plane, const Eigen::Isometry3d& world_from_camera, const HeightMap& seen,
                        double cell_m) {
  // Where the optical axis meets the plane; where it runs along it, the plane's point nearest to the camera.
  const double along = plane.normal.z();
  Eigen::Isometry3d camera_from_plane = Eigen::Isometry3d::Identity();
  const bool faces = along > 0.2;
  camera_from_plane.translation() =
      faces ? Eigen::Vector3d(0.0, 0.0, plane.distance_m / along) : Eigen::Vector3d(plane.distance_m * plane.normal);
  const Eigen::Vector3d right = Eigen::Vector3d::UnitX() - plane.normal.x() * plane.normal;
  const Eigen::Vector3d x =
      right.norm() > 0.1 ? Eigen::Vector3d(right.normalized()) : Eigen::Vector3d(plane.normal.unitOrthogonal());
  camera_from_plane.linear().col(0) = x;
  camera_from_plane.linear().col(1) = plane.normal.cross(x);
  camera_from_plane.linear().col(2) = plane.normal;
  PlaneMap map;
  map.world_from_plane = world_from_camera * camera_from_plane;
  const double pixel_m = camera_from_plane.translation().norm() / seen.intrinsics.fx_px;
  map.cell_m = cell_m > 0.0 ? cell_m : std::max(1e-4, 1e-4 * std::round(pixel_m / 1e-4));
  return map;
}

void fuse(PlaneMap& map, const HeightMap& frame, const NoiseModel& noise, const Eigen::Isometry3d& world_from_camera) {
  std::vector<Reading> readings = readings_of(map, frame, noise, world_from_camera);
  if (readings.empty()) return;
  grow(map, readings);
  std::erase_if(readings, [&](const Reading& reading) {
    return reading.col < map.first_col || reading.col >= map.first_col + map.width || reading.row < map.first_row ||
           reading.row >= map.first_row + map.height;
  });
  const auto cell_of = [&](const Reading& reading) {
    return static_cast<std::size_t>(reading.row - map.first_row) * static_cast<std::size_t>(map.width) +
           static_cast<std::size_t>(reading.col - map.first_col);
  };
  std::vector<FrameCell> cells(map.height_m.size());
  for (const Reading& reading : readings) {
    FrameCell& cell = cells[cell_of(reading)];
    if (!(cell.top_m >= reading.height_m)) cell.top_m = reading.height_m;
  }
  for (const Reading& reading : readings) {
    FrameCell& cell = cells[cell_of(reading)];
    if (reading.height_m < cell.top_m - 4.0F * reading.sigma_m - static_cast<float>(map.cell_m)) continue;
    cell.sum_m += reading.height_m;
    cell.sigma_m = std::max(cell.sigma_m, reading.sigma_m);
    ++cell.count;
  }
  for (std::size_t at = 0; at < cells.size(); ++at) {
    if (cells[at].count > 0) vote(map, at, cells[at].sum_m / static_cast<float>(cells[at].count), cells[at].sigma_m);
  }
}

}  // namespace tubetrack
