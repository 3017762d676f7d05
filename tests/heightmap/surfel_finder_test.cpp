#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "heightmap/slow_surfels.hpp"
#include "tubetrack/heightmap/normals.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

const Intrinsics kCamera{320, 240, 285.0, 285.0, 159.5, 119.5, {}};

/// Frames of two crossing cylinders before a wall, with the sensor's noise, and holes in them.
struct Stream {
  Intrinsics camera = kCamera;
  std::mt19937_64 random{11};
  double hole_share = 0.0;
  double noise_scale = 1.0;
  Vector3d shift_m = Vector3d::Zero();
  std::vector<std::uint16_t> pixels = {};

  static double depth_of(const Vector3d& ray, const Vector3d& center, const Vector3d& axis, double radius_m) {
    const Vector3d ray_across = ray - ray.dot(axis) * axis;
    const Vector3d center_across = center - center.dot(axis) * axis;
    const double a = ray_across.squaredNorm();
    const double b = ray_across.dot(center_across);
    const double discriminant = b * b - a * (center_across.squaredNorm() - radius_m * radius_m);
    return discriminant > 0.0 ? (b - std::sqrt(discriminant)) / a : 10.0;
  }

  DepthFrame next() {
    std::normal_distribution<double> gauss;
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    pixels.resize(static_cast<std::size_t>(camera.width * camera.height));
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const Eigen::Vector2d ray2 =
          normalized_ray(camera, static_cast<double>(i % static_cast<std::size_t>(camera.width)),
                         static_cast<double>(i / static_cast<std::size_t>(camera.width)));
      const Vector3d ray(ray2.x(), ray2.y(), 1.0);
      double z = 1.2 / (1.0 + 0.2 * ray.x() - 0.3 * ray.y());
      z = std::min(z, depth_of(ray, shift_m + Vector3d(0.0, 0.0, 0.8), Vector3d(1.0, 0.4, 0.1).normalized(), 0.03));
      z = std::min(z, depth_of(ray, Vector3d(0.1, 0.0, 0.9), Vector3d(0.2, 1.0, 0.0).normalized(), 0.045));
      z += noise_scale * axial_sigma_m({}, z, 0.0) * gauss(random);
      pixels[i] = unit(random) < hole_share ? 0 : static_cast<std::uint16_t>(std::lround(z / 1e-4));
    }
    return {pixels.data(), camera.width, camera.height, static_cast<std::size_t>(camera.width) * 2, 1e-4};
  }
};

/// Of all cells with a surfel by either, the share where only one has it; and how far those of both are apart.
struct Comparison {
  std::size_t both = 0;
  std::size_t one_only = 0;
  double worst_angle_rad = 0.0;
  double worst_position_m = 0.0;
  double worst_band = 0.0;  ///< relative
};

Comparison compare(std::span<const Surfel> a, std::span<const Surfel> b) {
  Comparison result;
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() || j < b.size()) {
    if (j == b.size() || (i < a.size() && a[i].cell < b[j].cell)) {
      ++result.one_only, ++i;
    } else if (i == a.size() || b[j].cell < a[i].cell) {
      ++result.one_only, ++j;
    } else {
      const Surfel& s = a[i++];
      const Surfel& t = b[j++];
      // Right at the gate the two may take planes of different windows.
      if (std::abs(s.radius_min_m - t.radius_min_m) > 0.02 * t.radius_min_m) {
        ++result.one_only;
        continue;
      }
      ++result.both;
      result.worst_angle_rad = std::max<double>(result.worst_angle_rad, s.inward_normal.cross(t.inward_normal).norm());
      result.worst_position_m = std::max<double>(result.worst_position_m, (s.position_m - t.position_m).norm());
      result.worst_band = std::max<double>(result.worst_band, std::abs(s.radius_max_m / t.radius_max_m - 1.0F));
    }
  }
  return result;
}

TEST(SurfelFinder, FindsWhatTheSlowOneFinds) {
  Intrinsics distorted = kCamera;
  distorted.distortion = {0.1, -0.05, 0.001, -0.002, 0.02};
  struct Case {
    Intrinsics camera;
    double hole_share;
    double noise_scale;
  };
  for (const Case& c : {Case{kCamera, 0.0, 1.0}, Case{kCamera, 0.1, 0.0}, Case{kCamera, 0.3, 1.0},
                        Case{distorted, 0.0, 1.0}, Case{distorted, 0.1, 1.0}}) {
    Stream stream;
    stream.camera = c.camera;
    stream.hole_share = c.hole_share;
    stream.noise_scale = c.noise_scale;
    HeightMap map = make_height_map(c.camera);
    update(map, stream.next(), {}, {}, true);
    const auto fast = tube_surfels(map, {}, {});
    const auto slow = slow_tube_surfels(map, {}, {});
    const Comparison result = compare(fast, slow);
    std::printf(
        "%s, holes %.1f, noise %.0f: %zu and %zu surfels, %zu in both, %zu in one; normals %.1e rad, "
        "positions %.1e m, bands %.1e\n",
        c.camera.has_distortion() ? "distorted" : "pinhole", c.hole_share, c.noise_scale, fast.size(), slow.size(),
        result.both, result.one_only, result.worst_angle_rad, result.worst_position_m, result.worst_band);
    EXPECT_GT(slow.size(), 1000U);
    // With distortion and holes the moments of the pixels stand in for those of the rays.
    EXPECT_LE(result.one_only, slow.size() / (c.camera.has_distortion() ? 100 : 500));
    EXPECT_LE(result.worst_angle_rad, 6e-4);  // heights are rounded to 2⁻¹⁶ /m
    EXPECT_LE(result.worst_position_m, 1e-5);
  }
}

}  // namespace
}  // namespace tubetrack
