#include "tubetrack/heightmap/normals.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <random>

#include "heightmap/slow_surfels.hpp"
#include "surfel_region.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

const Intrinsics kSmall{80, 60, 70.0, 70.0, 39.5, 29.5, {}};
const Intrinsics kCamera{640, 480, 570.0, 570.0, 319.5, 239.5, {}};

/// A map of one frame in 0.1 mm units; `depth_at` gives z in metres for a ray (x, y, 1), 0 for none.
HeightMap map_of(const Intrinsics& camera, auto depth_at) {
  HeightMap map = make_height_map(camera);
  std::vector<std::uint16_t> pixels(map.rays.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double z = depth_at(Vector3d(map.rays[i].x(), map.rays[i].y(), 1.0));
    pixels[i] = static_cast<std::uint16_t>(std::clamp(std::lround(z / 1e-4), 0L, 65535L));
  }
  const auto row_bytes = static_cast<std::size_t>(camera.width) * 2;
  update(map, {pixels.data(), camera.width, camera.height, row_bytes, 1e-4}, {}, {}, true);
  return map;
}

/// Edges, and where windows fit, of the whole image.
void fit_all(const HeightMap& map, SurfelWork& work) {
  const EdgeRule rule({}, map.intrinsics.fx_px);
  const WordArea all{0, map.intrinsics.height, 1, (map.intrinsics.width + kMargin_px + 63) / 64};
  take_heights(map, {0, map.intrinsics.width, 0, map.intrinsics.height}, work.heights);
  compare_cells(work.heights, rule, all, work.fits);
  find_borders(work.heights, rule, all, work.fits);
  fit_windows(all, work.fits, work.bands[0].spread);
}

/// Planes as the surfel stage makes them: wherever the window is within the image, or (`edges`) on one side of edges
/// too.
std::vector<WindowPlane> window_planes(const HeightMap& map, std::size_t size, bool edges = false) {
  const int width = map.intrinsics.width;
  const int height = map.intrinsics.height;
  const int half = kWindowHalfSizes_px[size];
  SurfelWork work;
  prepare(map, 1, work);
  fit_all(map, work);
  Windows& windows = work.fits.windows[size];
  for (int v = half; v < height - half && !edges; ++v) {
    for (int u = half; u < width - half; ++u) {
      if (map.count[map.cell(u, v)] > 0) windows.fits.set(u, v);
    }
  }
  const int columns = (width + 31) / 32 * 32;
  const std::vector<std::uint8_t> near_holes(static_cast<std::size_t>(columns / 32 + 2), 1);
  work.bands[0].sums.start(-32, columns + 64);
  work.bands[0].planes[size].start(half, 0, columns);
  std::vector<WindowPlane> planes(map.rays.size());
  int summed = 0;
  for (int v = 0; v < height; ++v) {
    for (; summed < std::min(height, v + half + 1); ++summed)
      work.bands[0].sums.add_row(work.heights, summed, -32, columns + 32, near_holes.data());
    planes_of_row(work.bands[0].sums, windows.fits, windows.holes, v, 0, columns, work.bands[0].planes[size]);
    const PlaneRow row = work.bands[0].planes[size].row(v);
    for (int u = 0; u < width; ++u) {
      if (row.slope_u[u] >= kNoPlane) continue;
      const std::size_t at = map.cell(u, v);
      const double a = row.slope_u[u] * map.intrinsics.fx_px;
      const double b = row.slope_v[u] * map.intrinsics.fy_px;
      const Vector3d ray(map.rays[at].x(), map.rays[at].y(), 1.0);
      const Vector3d normal(a, b, row.height[u] - a * ray.x() - b * ray.y());
      planes[at] = {normal.normalized(), ray / row.height[u],
                    row.slope_sigma[u] * map.intrinsics.fx_px / normal.norm()};
    }
  }
  return planes;
}

/// z of the plane n·p = d along a ray.
double plane_depth(const Vector3d& normal, double distance_m, const Vector3d& ray) {
  return distance_m / normal.dot(ray);
}

double angle(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

TEST(WindowPlanes, OfAPlaneAreThatPlane) {
  for (const Vector3d& raw : {Vector3d(0, 0, 1), Vector3d(0.5, -0.3, 1), Vector3d(-0.8, 0.2, 1)}) {
    const Vector3d normal = raw.normalized();
    HeightMap map = make_height_map(kSmall);
    for (std::size_t i = 0; i < map.rays.size(); ++i) {
      const double z = plane_depth(normal, 0.7, Vector3d(map.rays[i].x(), map.rays[i].y(), 1.0));
      map.depth_m[i] = static_cast<float>(z);
      map.inverse_depth_per_m[i] = static_cast<float>(1.0 / z);
      map.variance_per_m2[i] = 1e-6F;
      map.count[i] = 1;
    }
    for (std::size_t size = 0; size < kWindowHalfSizes_px.size(); ++size) {
      const int half = kWindowHalfSizes_px[size];
      const auto planes = window_planes(map, size);
      int found = 0;
      for (const WindowPlane& plane : planes) {
        if (plane.angle_sigma_rad <= 0.0) continue;
        ++found;
        EXPECT_LT(angle(plane.inward_normal, normal), 1e-4);
        EXPECT_NEAR(plane.position_m.dot(normal), 0.7, 1e-5);
      }
      EXPECT_EQ(found, (80 - 2 * half) * (60 - 2 * half));
    }
  }
}

/// The plane w = a·x + b·y + c over a window by a QR decomposition.
Vector3d plane_by_qr(const HeightMap& map, int u, int v, int half) {
  std::vector<std::size_t> cells;
  for (int dv = -half; dv <= half; ++dv) {
    for (int du = -half; du <= half; ++du) {
      if (map.count[map.cell(u + du, v + dv)] > 0) cells.push_back(map.cell(u + du, v + dv));
    }
  }
  const auto rows = static_cast<Eigen::Index>(cells.size());
  Eigen::MatrixXd left(rows, 3);
  Eigen::VectorXd right(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const std::size_t at = cells[static_cast<std::size_t>(i)];
    left.row(i) << map.rays[at].x(), map.rays[at].y(), 1.0;
    right[i] = map.inverse_depth_per_m[at];
  }
  return left.colPivHouseholderQr().solve(right);
}

TEST(WindowPlanes, AreTheLeastSquaresPlanesOfTheirWindows) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const HeightMap map = map_of(kSmall, [&](const Vector3d& ray) {
    const double z = 0.8 + 0.1 * ray.x() - 0.2 * ray.y() * ray.y() + 0.003 * gauss(random);
    return unit(random) < 0.2 ? 0.0 : z;
  });
  for (std::size_t size = 0; size < kWindowHalfSizes_px.size(); ++size) {
    const int half = kWindowHalfSizes_px[size];
    const auto planes = window_planes(map, size);
    int compared = 0;
    for (int v = half; v < 60 - half; v += 5) {
      for (int u = half; u < 80 - half; u += 7) {
        const std::size_t at = map.cell(u, v);
        if (planes[at].angle_sigma_rad <= 0.0) continue;
        const Vector3d plane = plane_by_qr(map, u, v, half);
        EXPECT_LT(angle(planes[at].inward_normal, plane), 1e-4);  // heights are rounded to 2⁻¹⁶ /m
        const double w = plane.dot(Vector3d(map.rays[at].x(), map.rays[at].y(), 1.0));
        EXPECT_NEAR(planes[at].position_m.z(), 1.0 / w, 1e-5);
        ++compared;
      }
    }
    EXPECT_GT(compared, 20);
  }
}

TEST(WindowPlanes, SayHowUncertainTheNormalIs) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> gauss;
  const double sigma = axial_sigma_m({}, 0.8, 0.0);
  const HeightMap map = map_of(kCamera, [&](const Vector3d&) { return 0.8 + sigma * gauss(random); });
  for (std::size_t size = 0; size < kWindowHalfSizes_px.size(); ++size) {
    const int half = kWindowHalfSizes_px[size];
    const auto planes = window_planes(map, size);
    double squares = 0.0;
    double says = 0.0;
    int n = 0;
    for (int v = 20; v < 460; v += 2 * half + 1) {
      for (int u = 20; u < 620; u += 2 * half + 1) {
        const WindowPlane& plane = planes[map.cell(u, v)];
        ASSERT_GT(plane.angle_sigma_rad, 0.0);
        // Tilt about one axis: of a wall straight ahead, the slope along x.
        const double off = plane.inward_normal.x() / plane.inward_normal.z();
        squares += off * off;
        says += plane.angle_sigma_rad;
        ++n;
      }
    }
    EXPECT_NEAR(std::sqrt(squares / n) / (says / n), 1.0, 0.15) << half;
  }
}

TEST(WindowPlanes, AreOnlyWhereTheWindowStaysOnOneSideOfEdges) {
  const HeightMap map = map_of(kSmall, [](const Vector3d& ray) { return ray.x() < 0.0 ? 0.8 : 1.1; });
  for (std::size_t size = 0; size < kWindowHalfSizes_px.size(); ++size) {
    const int half = kWindowHalfSizes_px[size];
    const auto planes = window_planes(map, size, true);
    for (int v = 0; v < 60; ++v) {
      for (int u = 0; u < 80; ++u) {
        const int edge = u < 40 ? 39 - u : u - 40;  // from the edge's own pixel
        const bool inside = u >= half && v >= half && u < 80 - half && v < 60 - half;
        EXPECT_EQ(planes[map.cell(u, v)].angle_sigma_rad > 0.0, inside && edge > half) << u << ' ' << v;
      }
    }
  }
}

SurfelWork with_windows(const HeightMap& map) {
  SurfelWork work;
  prepare(map, 1, work);
  fit_all(map, work);
  return work;
}

int edges_in_row(const HeightMap& map, int v) {
  const SurfelWork work = with_windows(map);
  int count = 0;
  for (int u = 0; u < map.intrinsics.width; ++u) count += work.fits.edges.edges.get(u, v) ? 1 : 0;
  return count;
}

TEST(Edges, AWindowFitsWhereItsHalfSizeIsLessThanTheDistanceToEdgesAndTheBorder) {
  const HeightMap map = map_of(kSmall, [](const Vector3d& ray) {
    const bool near = std::abs(ray.x()) < 0.1 && ray.y() > -0.2 && ray.y() < 0.15;
    return near ? 0.6 : 0.9;
  });
  const auto is_near = [&](int u, int v) { return map.depth_m[map.cell(u, v)] < 0.7F; };
  std::vector<std::pair<int, int>> edges;
  for (int v = 0; v < 60; ++v) {
    for (int u = 0; u < 80; ++u) {
      const bool edge = (u > 0 && is_near(u - 1, v) != is_near(u, v)) ||
                        (u < 79 && is_near(u + 1, v) != is_near(u, v)) ||
                        (v > 0 && is_near(u, v - 1) != is_near(u, v)) || (v < 59 && is_near(u, v + 1) != is_near(u, v));
      if (edge) edges.emplace_back(u, v);
    }
  }
  ASSERT_GT(edges.size(), 20U);
  const auto distance = slow_edge_distances(map, {});
  const SurfelWork work = with_windows(map);
  for (int v = 0; v < 60; ++v) {
    for (int u = 0; u < 80; ++u) {
      int expected = std::min({u + 1, v + 1, 80 - u, 60 - v});
      for (const auto& [eu, ev] : edges) expected = std::min(expected, std::max(std::abs(eu - u), std::abs(ev - v)));
      EXPECT_EQ(distance[map.cell(u, v)], expected) << u << ' ' << v;
      for (std::size_t size = 0; size < kWindowHalfSizes_px.size(); ++size) {
        EXPECT_EQ(work.fits.windows[size].fits.get(u, v), expected > kWindowHalfSizes_px[size]) << u << ' ' << v;
      }
    }
  }
}

TEST(Edges, AGapWithoutReturnsBetweenTwoDepthsIsAnEdge) {
  const HeightMap map = map_of(kSmall, [](const Vector3d& ray) {
    if (std::abs(ray.x()) < 0.06) return 0.0;
    return ray.x() < 0.0 ? 0.8 : 1.1;
  });
  EXPECT_GT(edges_in_row(map, 30), 0);
  const HeightMap flat = map_of(kSmall, [](const Vector3d& ray) { return std::abs(ray.x()) < 0.06 ? 0.0 : 0.8; });
  for (int v = 0; v < 60; ++v) EXPECT_EQ(edges_in_row(flat, v), 0);
}

/// A cylinder across the view, 0.8 m away, in front of a wall.
HeightMap cylinder(double radius_m, const Vector3d& axis) {
  const Vector3d center(0.0, 0.0, 0.8);
  return map_of(kCamera, [&](const Vector3d& ray) {
    const Vector3d ray_across = ray - ray.dot(axis) * axis;
    const Vector3d center_across = center - center.dot(axis) * axis;
    const double a = ray_across.squaredNorm();
    const double b = ray_across.dot(center_across);
    const double discriminant = b * b - a * (center_across.squaredNorm() - radius_m * radius_m);
    return discriminant > 0.0 ? (b - std::sqrt(discriminant)) / a : 1.2;
  });
}

TEST(TubeSurfels, OfACylinderHaveItsRadiusInTheirBandAndPointAtItsAxis) {
  for (const double radius : {0.012, 0.02, 0.035, 0.06}) {
    for (const Vector3d& raw : {Vector3d(1, 0, 0), Vector3d(0.3, 1, 0), Vector3d(1, -0.7, 0.3)}) {
      const Vector3d axis = raw.normalized();
      const auto surfels = tube_surfels(cylinder(radius, axis), {}, {});
      int inside = 0;
      int pointing = 0;
      for (const Surfel& surfel : surfels) {
        inside += surfel.radius_min_m <= radius && radius <= surfel.radius_max_m ? 1 : 0;
        const Vector3d center = (surfel.position_m + static_cast<float>(radius) * surfel.inward_normal).cast<double>();
        const double off = (center - Vector3d(0, 0, 0.8)).cross(axis).norm();
        pointing += off < 0.15 * radius ? 1 : 0;
      }
      const auto n = static_cast<double>(surfels.size());
      std::printf("R %.0f mm: %zu surfels, radius in band %.1f %%, pointing at the axis %.1f %%\n", 1e3 * radius,
                  surfels.size(), 100.0 * inside / n, 100.0 * pointing / n);
      EXPECT_GT(surfels.size(), 300U) << radius;
      EXPECT_GE(inside / n, 0.99) << radius;
      EXPECT_GE(pointing / n, 0.99) << radius;
    }
  }
}

TEST(TubeSurfels, ComeInCellOrderOneACell) {
  const auto surfels = tube_surfels(cylinder(0.02, Vector3d::UnitX()), {}, {});
  for (std::size_t i = 1; i < surfels.size(); ++i) EXPECT_LT(surfels[i - 1].cell, surfels[i].cell);
}

TEST(TubeSurfels, OfACylinderOutOfTheWantedRadiiAreNone) {
  EXPECT_TRUE(tube_surfels(cylinder(0.05, Vector3d::UnitX()), {}, {0.005, 0.012}).empty());
}

TEST(TubeSurfels, OfAHollowOneAreNone) {
  const Vector3d center(0.0, 0.0, 0.8);
  const HeightMap map = map_of(kCamera, [&](const Vector3d& ray) {
    const double a = ray.y() * ray.y() + 1.0;
    const double discriminant = 0.64 - a * (0.64 - 0.03 * 0.03);
    return discriminant > 0.0 ? (0.8 + std::sqrt(discriminant)) / a : 0.0;  // the far side, seen from inside
  });
  EXPECT_TRUE(tube_surfels(map, {}, {}).empty());
}

TEST(TubeSurfels, OfANoisyFlatWallAreFew) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> gauss;
  for (const double depth : {0.6, 0.8, 1.2}) {
    const double sigma = axial_sigma_m({}, depth, 0.0);
    const HeightMap map = map_of(kCamera, [&](const Vector3d&) { return depth + sigma * gauss(random); });
    const double share = static_cast<double>(tube_surfels(map, {}, {}).size()) / (640.0 * 480.0);
    std::printf("wall at %.1f m: %.3f %% of the pixels\n", depth, 100.0 * share);
    EXPECT_LT(share, 0.005) << depth;
  }
}

TEST(TubeSurfels, OfANoisySlantedTableAreFew) {
  const NoiseModel noise;
  for (const double slant_rad : {0.5, 0.8, 1.1}) {
    std::mt19937_64 random(5);
    std::normal_distribution<double> gauss;
    const Vector3d normal(0.0, std::sin(slant_rad), std::cos(slant_rad));
    const HeightMap map = map_of(kCamera, [&](const Vector3d& ray) {
      const double px = noise.lateral_px / kCamera.fx_px;
      const double depth =
          plane_depth(normal, 0.8 * normal.z(), ray + Vector3d(px * gauss(random), px * gauss(random), 0.0));
      return depth + axial_sigma_m(noise, depth, 0.0) * gauss(random);
    });
    const double share = static_cast<double>(tube_surfels(map, noise, {}).size()) / (640.0 * 480.0);
    std::printf("table at %.1f rad: %.3f %% of the pixels\n", slant_rad, 100.0 * share);
    EXPECT_LT(share, 0.003) << slant_rad;
  }
}

TEST(TubeSurfels, AFlankVotesThoughItsReadingsJitterSideways) {
  // As many as without that noise in the model: the flattest window beside a flank says what a plane there may be.
  NoiseModel no_jitter;
  no_jitter.lateral_px = 0.0;
  for (const double radius : {0.012, 0.02, 0.035, 0.06}) {
    const HeightMap map = cylinder(radius, Vector3d(1.0, -0.7, 0.3).normalized());
    const auto votes = static_cast<double>(tube_surfels(map, {}, {}).size());
    const double share = votes / static_cast<double>(tube_surfels(map, no_jitter, {}).size());
    std::printf("R %.0f mm: %.1f %% of the surfels vote\n", 1e3 * radius, 100.0 * share);
    EXPECT_GT(share, 0.98) << radius;
  }
}

}  // namespace
}  // namespace tubetrack
