#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// Pinhole camera with the ROS/OpenCV distortion model (k1 k2 p1 p2 k3 k4 k5 k6; plumb_bob uses the first five).
/// Camera frame: x right, y down, z forward, metres; pixel centres at integers; lengths in pixels.
struct Intrinsics {
  int width = 0;
  int height = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  std::array<double, 8> distortion{};

  bool has_distortion() const;
};

/// Names the first field that cannot be right (size ≤ 0, focal length zero, negative or not finite, …).
Expected<void> validate(const Intrinsics& intrinsics);

/// f = size / 2 / tan(fov / 2), principal point in the image centre ((size − 1) / 2). Angles in radians.
Intrinsics intrinsics_from_field_of_view(int width, int height, double horizontal_rad, double vertical_rad);

/// The camera that a user gives for a device that sends images of a size: a calibration, or else fx, fy, cx, cy in
/// pixels, without distortion; nothing where neither is given. The error says that the calibration is for another size;
/// `name` is the device's.
Expected<std::optional<Intrinsics>> given_intrinsics(const std::string& name, int width, int height,
                                                     const std::optional<Intrinsics>& calibration,
                                                     const std::optional<std::array<double, 4>>& numbers_px);

/// Pixel of a camera-frame point (metres, z > 0), distortion applied.
Eigen::Vector2d project(const Intrinsics& intrinsics, const Eigen::Vector3d& point_in_camera);

/// (x/z, y/z) of the ray through a pixel; distortion undone by fixed-point iteration.
Eigen::Vector2d normalized_ray(const Intrinsics& intrinsics, double u_px, double v_px);

/// `normalized_ray` of every pixel, row-major; a point is depth_m * (x, y, 1).
std::vector<Eigen::Vector2f> ray_table(const Intrinsics& intrinsics);

}  // namespace tubetrack
