#include "tubetrack/sensors/intrinsics.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace tubetrack {

namespace {

/// The ROS/OpenCV model: ideal (x, y) → distorted (x, y), both at z = 1.
Eigen::Vector2d distort(const std::array<double, 8>& k, const Eigen::Vector2d& ideal) {
  const double x = ideal.x();
  const double y = ideal.y();
  const double r2 = x * x + y * y;
  const double radial = (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return {x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x),
          y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y};
}

}  // namespace

bool Intrinsics::has_distortion() const {
  return std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0.0; });
}

Expected<void> validate(const Intrinsics& in) {
  const auto refuse = [](const char* field, double got, const char* takes) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: got {:g}, takes {}", field, got, takes)));
  };
  if (in.width < 1 || in.width > 16384) return refuse("image_width", in.width, "1 to 16384 pixels");
  if (in.height < 1 || in.height > 16384) return refuse("image_height", in.height, "1 to 16384 pixels");
  const auto focal_ok = [](double f) { return std::isfinite(f) && f > 0.0; };
  if (!focal_ok(in.fx_px)) return refuse("fx", in.fx_px, "a focal length in pixels, above 0");
  if (!focal_ok(in.fy_px)) return refuse("fy", in.fy_px, "a focal length in pixels, above 0");
  if (!std::isfinite(in.cx_px)) return refuse("cx", in.cx_px, "the principal point in pixels");
  if (!std::isfinite(in.cy_px)) return refuse("cy", in.cy_px, "the principal point in pixels");
  for (const double k : in.distortion) {
    if (!std::isfinite(k)) return refuse("distortion_coefficients", k, "finite numbers");
  }
  return {};
}

Intrinsics intrinsics_from_field_of_view(int width, int height, double horizontal_rad, double vertical_rad) {
  Intrinsics in;
  in.width = width;
  in.height = height;
  in.fx_px = width / 2.0 / std::tan(horizontal_rad / 2.0);
  in.fy_px = height / 2.0 / std::tan(vertical_rad / 2.0);
  in.cx_px = (width - 1) / 2.0;
  in.cy_px = (height - 1) / 2.0;
  return in;
}

Expected<std::optional<Intrinsics>> given_intrinsics(const std::string& name, int width, int height,
                                                     const std::optional<Intrinsics>& calibration,
                                                     const std::optional<std::array<double, 4>>& numbers_px) {
  if (calibration && (calibration->width != width || calibration->height != height)) {
    return tl::make_unexpected(Error::usage(
        fmt::format("{}: the calibration is for {}x{} pixels and the device sends {}x{}; choose the mode it was made "
                    "for, or calibrate this one",
                    name, calibration->width, calibration->height, width, height)));
  }
  if (calibration) return calibration;
  if (!numbers_px) return std::nullopt;
  const auto [fx, fy, cx, cy] = *numbers_px;
  return Intrinsics{width, height, fx, fy, cx, cy, {}};
}

Eigen::Vector2d project(const Intrinsics& in, const Eigen::Vector3d& point_in_camera) {
  const Eigen::Vector2d image = distort(in.distortion, point_in_camera.hnormalized());
  return {in.fx_px * image.x() + in.cx_px, in.fy_px * image.y() + in.cy_px};
}

Eigen::Vector2d normalized_ray(const Intrinsics& in, double u_px, double v_px) {
  Eigen::Vector2d seen((u_px - in.cx_px) / in.fx_px, (v_px - in.cy_px) / in.fy_px);
  if (!in.has_distortion()) return seen;
  Eigen::Vector2d ideal = seen;
  // Some ten rounds for a mild lens; a strong one contracts slowly in the corners, so the end is where nothing moves.
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d step = seen - distort(in.distortion, ideal);
    ideal += step;
    if (step.squaredNorm() < 1e-24) break;
  }
  return ideal;
}

std::vector<Eigen::Vector2f> ray_table(const Intrinsics& in) {
  std::vector<Eigen::Vector2f> rays;
  rays.reserve(static_cast<std::size_t>(in.width) * static_cast<std::size_t>(in.height));
  for (int v = 0; v < in.height; ++v) {
    for (int u = 0; u < in.width; ++u) rays.push_back(normalized_ray(in, u, v).cast<float>());
  }
  return rays;
}

}  // namespace tubetrack
