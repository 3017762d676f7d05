#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <span>
#include <vector>

#include "tubetrack/heightmap/normals.hpp"

namespace tubetrack {

inline const Intrinsics kStreamCamera{320, 240, 285.0, 285.0, 159.5, 119.5, {}};

/// Frames of two crossing cylinders before a wall, with the sensor's noise, and holes in them.
struct Stream {
  Intrinsics camera = kStreamCamera;
  std::mt19937_64 random{11};
  double hole_share = 0.0;
  double noise_scale = 1.0;
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  std::vector<std::uint16_t> pixels = {};

  static double depth_of(const Eigen::Vector3d& ray, const Eigen::Vector3d& center, const Eigen::Vector3d& axis,
                         double radius_m) {
    const Eigen::Vector3d ray_across = ray - ray.dot(axis) * axis;
    const Eigen::Vector3d center_across = center - center.dot(axis) * axis;
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
      const Eigen::Vector3d ray(ray2.x(), ray2.y(), 1.0);
      double z = 1.2 / (1.0 + 0.2 * ray.x() - 0.3 * ray.y());
      z = std::min(z, depth_of(ray, shift_m + Eigen::Vector3d(0.0, 0.0, 0.8),
                               Eigen::Vector3d(1.0, 0.4, 0.1).normalized(), 0.03));
      z = std::min(z,
                   depth_of(ray, Eigen::Vector3d(0.1, 0.0, 0.9), Eigen::Vector3d(0.2, 1.0, 0.0).normalized(), 0.045));
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

inline Comparison compare(std::span<const Surfel> a, std::span<const Surfel> b) {
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

}  // namespace tubetrack
