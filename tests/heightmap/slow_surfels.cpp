#include "heightmap/slow_surfels.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace tubetrack {

namespace {

/// Sums over a window of x, y, w and their products, (x, y) from the middle's ray, and of w's variance.
constexpr int kMoments = 10;
using Moments = Eigen::Array<double, kMoments, 1>;

Moments sums_of(const HeightMap& map, int u, int v, int half) {
  Moments sums = Moments::Zero();
  const Eigen::Vector2f middle = map.rays[map.cell(u, v)];
  for (int row = v - half; row <= v + half; ++row) {
    for (int col = u - half; col <= u + half; ++col) {
      const std::size_t at = map.cell(col, row);
      if (map.count[at] == 0) continue;
      const double x = map.rays[at].x() - middle.x();
      const double y = map.rays[at].y() - middle.y();
      const double w = map.inverse_depth_per_m[at];
      Moments m;
      m << 1.0, x, y, x * x, x * y, y * y, w, x * w, y * w, map.variance_per_m2[at];
      sums += m;
    }
  }
  return sums;
}

/// The plane of a window from its sums; leaves `plane` without normal where too few cells or no slope is determined.
void solve_plane(const Moments& m, const Eigen::Vector2f& ray, double cells, WindowPlane& plane) {
  const double n = m[0];
  if (n < 0.6 * cells) return;
  const double mx = m[1] / n;
  const double my = m[2] / n;
  const double mw = m[6] / n;
  const double sxx = m[3] - n * mx * mx;
  const double sxy = m[4] - n * mx * my;
  const double syy = m[5] - n * my * my;
  const double det = sxx * syy - sxy * sxy;
  if (det <= 1e-3 * sxx * syy) return;
  const double sxw = m[7] - n * mx * mw;
  const double syw = m[8] - n * my * mw;
  const double a = (sxw * syy - syw * sxy) / det;
  const double b = (syw * sxx - sxw * sxy) / det;
  const double w = mw - a * mx - b * my;
  const double c = w - a * ray.x() - b * ray.y();
  const double norm = std::sqrt(a * a + b * b + c * c);
  if (w <= 0.0 || norm <= 0.0) return;
  plane.inward_normal = Eigen::Vector3d(a / norm, b / norm, c / norm);
  plane.position_m = Eigen::Vector3d(ray.x() / w, ray.y() / w, 1.0 / w);
  plane.angle_sigma_rad = std::sqrt(m[9] / n / std::min(sxx, syy)) / norm;
}

/// Greater and lesser curvature (1/m, convex towards the camera positive) and the σ of one, from how the normal turns
/// between planes to either side.
struct Curvature {
  bool known = false;
  double greater_per_m = 0.0;
  double lesser_per_m = 0.0;
  double sigma_per_m = 0.0;
};

struct Turn {
  Eigen::Vector3d step_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  bool known = false;
};

/// Between the planes `offset` cells to either side of `at`, or from `at` to the one side that has a plane.
Turn turn_across(const std::vector<WindowPlane>& planes, std::size_t at, std::ptrdiff_t offset) {
  const auto index = static_cast<std::ptrdiff_t>(at);
  const auto has = [&](std::ptrdiff_t i) {
    return i >= 0 && i < static_cast<std::ptrdiff_t>(planes.size()) &&
           planes[static_cast<std::size_t>(i)].angle_sigma_rad > 0.0;
  };
  const std::ptrdiff_t from = has(index - offset) ? index - offset : index;
  const std::ptrdiff_t to = has(index + offset) ? index + offset : index;
  if (from == to) return {};
  const WindowPlane& first = planes[static_cast<std::size_t>(from)];
  const WindowPlane& second = planes[static_cast<std::size_t>(to)];
  return {second.position_m - first.position_m, second.inward_normal - first.inward_normal, true};
}

Curvature curvature_at(const std::vector<WindowPlane>& planes, std::size_t at, int width, int half_px) {
  const Turn across = turn_across(planes, at, half_px);
  const Turn down = turn_across(planes, at, static_cast<std::ptrdiff_t>(half_px) * width);
  if (!across.known || !down.known) return {};
  const Eigen::Vector3d normal = planes[at].inward_normal;
  const Eigen::Vector3d e1 = normal.unitOrthogonal();
  const Eigen::Vector3d e2 = normal.cross(e1);
  Eigen::Matrix2d steps;
  steps << e1.dot(across.step_m), e1.dot(down.step_m), e2.dot(across.step_m), e2.dot(down.step_m);
  Eigen::Matrix2d turns;
  turns << e1.dot(across.turn), e1.dot(down.turn), e2.dot(across.turn), e2.dot(down.turn);
  if (std::abs(steps.determinant()) < 1e-3 * steps.col(0).norm() * steps.col(1).norm()) return {};
  // Inward normals of a convex surface converge, so the shape operator is the negative of their turn.
  const Eigen::Matrix2d shape = -turns * steps.inverse();
  const double mean = 0.5 * (shape(0, 0) + shape(1, 1));
  const double off = 0.5 * (shape(0, 1) + shape(1, 0));
  const double spread = std::hypot(0.5 * (shape(0, 0) - shape(1, 1)), off);
  const double step = std::min(steps.col(0).norm(), steps.col(1).norm());
  return {true, mean + spread, mean - spread, std::sqrt(2.0) * planes[at].angle_sigma_rad / step};
}

/// How much larger the σ of a slope is if all this is a plane: by what readings on a slope jitter sideways, where the
/// flattest of the windows is the slope.
double sideways_factor(const std::vector<WindowPlane>& planes, std::size_t at, const Intrinsics& in, int half_px,
                       const NoiseModel& noise) {
  const auto index = static_cast<std::ptrdiff_t>(at);
  const std::ptrdiff_t down = static_cast<std::ptrdiff_t>(half_px) * in.width;
  double least = std::numeric_limits<double>::infinity();
  for (const std::ptrdiff_t i : {index, index - half_px, index + half_px, index - down, index + down}) {
    if (i < 0 || i >= static_cast<std::ptrdiff_t>(planes.size())) continue;
    const WindowPlane& plane = planes[static_cast<std::size_t>(i)];
    if (plane.angle_sigma_rad <= 0.0) continue;
    const Eigen::Vector3d per_ray = plane.inward_normal / plane.inward_normal.dot(plane.position_m);
    least = std::min(least, Eigen::Vector2d(per_ray.x() / in.fx_px, per_ray.y() / in.fy_px).squaredNorm());
  }
  const double side = 2.0 * half_px + 1.0;
  const double moment_px2 = side * side * half_px * (half_px + 1.0) / 3.0;
  const WindowPlane& plane = planes[at];
  const double axial_per_px = plane.angle_sigma_rad / plane.inward_normal.dot(plane.position_m) / in.fx_px;
  return std::sqrt(1.0 + noise.lateral_px * noise.lateral_px * least / moment_px2 / (axial_per_px * axial_per_px));
}

}  // namespace

std::vector<std::uint8_t> slow_edge_distances(const HeightMap& map, const NoiseModel& noise) {
  const int width = map.intrinsics.width;
  const int height = map.intrinsics.height;
  std::vector<std::uint8_t> distance(map.rays.size(), 255);
  const double pixel = 1.0 / map.intrinsics.fx_px;
  const auto is_edge = [&](std::size_t a, std::size_t b, int gap_px) {
    const double wa = map.inverse_depth_per_m[a];
    const double wb = map.inverse_depth_per_m[b];
    const double z = 2.0 / (wa + wb);
    // A surface seen at 78° drops 4.7 pixel widths from one pixel to the next.
    const double allowed = 4.0 * axial_sigma_m(noise, z, 0.0) + 4.7 * z * pixel * std::min(gap_px, 3);
    return std::abs(1.0 / wa - 1.0 / wb) > allowed;
  };
  const auto scan = [&](int lines, int length, auto cell_at) {
    for (int line = 0; line < lines; ++line) {
      int last = -1;
      for (int i = 0; i < length; ++i) {
        const std::size_t at = cell_at(line, i);
        if (map.count[at] == 0) continue;
        if (last >= 0 && i - last <= 20 && is_edge(cell_at(line, last), at, i - last)) {
          distance[cell_at(line, last)] = 0;
          distance[at] = 0;
        }
        last = i;
      }
    }
  };
  scan(height, width, [&](int v, int u) { return map.cell(u, v); });
  scan(width, height, [&](int u, int v) { return map.cell(u, v); });
  const auto pull = [&](int u, int v, int du, int dv) {
    const bool inside = u + du >= 0 && u + du < width && v + dv >= 0 && v + dv < height;
    const int from = inside ? distance[map.cell(u + du, v + dv)] : 0;
    std::uint8_t& here = distance[map.cell(u, v)];
    here = static_cast<std::uint8_t>(std::min<int>(here, from + 1));
  };
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      for (const auto& [du, dv] : {std::pair{-1, -1}, {0, -1}, {1, -1}, {-1, 0}}) pull(u, v, du, dv);
    }
  }
  for (int v = height - 1; v >= 0; --v) {
    for (int u = width - 1; u >= 0; --u) {
      for (const auto& [du, dv] : {std::pair{1, 1}, {0, 1}, {-1, 1}, {1, 0}}) pull(u, v, du, dv);
    }
  }
  return distance;
}

std::vector<WindowPlane> slow_window_planes(const HeightMap& map, int half_px,
                                            const std::vector<std::uint8_t>& edge_distance_px) {
  const double cells = (2.0 * half_px + 1.0) * (2.0 * half_px + 1.0);
  std::vector<WindowPlane> planes(map.rays.size());
  for (int v = half_px; v < map.intrinsics.height - half_px; ++v) {
    for (int u = half_px; u < map.intrinsics.width - half_px; ++u) {
      const std::size_t at = map.cell(u, v);
      if (map.count[at] == 0 || edge_distance_px[at] <= half_px) continue;
      solve_plane(sums_of(map, u, v, half_px), map.rays[at], cells, planes[at]);
    }
  }
  return planes;
}

std::vector<Surfel> slow_tube_surfels(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options) {
  const std::vector<std::uint8_t> distance = slow_edge_distances(map, noise);
  std::vector<std::vector<WindowPlane>> scales;
  scales.reserve(kWindowHalfSizes_px.size());
  for (const int half : kWindowHalfSizes_px) scales.push_back(slow_window_planes(map, half, distance));
  std::vector<Surfel> surfels;
  const auto width = static_cast<std::size_t>(map.intrinsics.width);
  std::vector<bool> has_surfel(map.rays.size(), false);
  // Odd rows are searched by pieces of 16 columns, where the row above has a surfel up to 8 columns beside.
  const auto is_searched = [&](std::size_t at) {
    const std::size_t u = at % width;
    if (at / width % 2 == 0) return true;
    const std::size_t row = at - u - width;
    const std::size_t end = std::min(width, u / 16 * 16 + 24);
    for (std::size_t col = u / 16 * 16 - (u < 16 ? 0 : 8); col < end; ++col) {
      if (has_surfel[row + col]) return true;
    }
    return false;
  };
  for (std::size_t at = 0; at < map.rays.size(); ++at) {
    if (!is_searched(at)) continue;
    for (std::size_t scale = scales.size(); scale-- > 0;) {
      const WindowPlane& plane = scales[scale][at];
      if (plane.angle_sigma_rad <= 0.0) continue;
      const int half = kWindowHalfSizes_px[scale];
      const Curvature k = curvature_at(scales[scale], at, map.intrinsics.width, half);
      if (!k.known) continue;
      const double flat_sigma_per_m = k.sigma_per_m * sideways_factor(scales[scale], at, map.intrinsics, half, noise);
      if (k.greater_per_m < options.gate_sigmas * flat_sigma_per_m) continue;
      const double half_m = half * plane.position_m.z() / map.intrinsics.fx_px;
      if (k.greater_per_m * half_m > 0.8) continue;  // the window is wider than the tube it suggests
      const double low = 1.0 / (k.greater_per_m + 2.0 * k.sigma_per_m) * 0.8;
      const double high = 1.0 / (k.greater_per_m - 2.0 * k.sigma_per_m) * 1.25;
      if (high < options.radius_min_m || low > options.radius_max_m) continue;
      Surfel surfel;
      surfel.position_m = plane.position_m.cast<float>();
      surfel.inward_normal = plane.inward_normal.cast<float>();
      surfel.sigma_m = static_cast<float>(axial_sigma_m(noise, plane.position_m.z(), 0.0));
      surfel.radius_min_m = static_cast<float>(std::max(low, options.radius_min_m));
      surfel.radius_max_m = static_cast<float>(std::min(high, options.radius_max_m));
      surfel.cell = static_cast<std::uint32_t>(at);
      surfels.push_back(surfel);
      has_surfel[at] = true;
      break;
    }
  }
  return surfels;
}

}  // namespace tubetrack
