#include "scene_caster.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tubetrack {

namespace {

constexpr double kNear = 0.01;  ///< a primitive that comes nearer than this may cover any pixel

/// A region of (x/z, y/z).
struct ViewRectangle {
  double x_min = -std::numeric_limits<double>::infinity();
  double x_max = std::numeric_limits<double>::infinity();
  double y_min = -std::numeric_limits<double>::infinity();
  double y_max = std::numeric_limits<double>::infinity();

  bool holds(double x, double y) const { return x >= x_min && x <= x_max && y >= y_min && y <= y_max; }
};

/// Holds the primitive as seen from `eye`: the corners of the cubes round its bounding balls.
ViewRectangle view_rectangle(const Primitive& primitive, const Eigen::Vector3d& eye) {
  const std::vector<Ball> balls = bounding_balls(primitive.shape);
  if (balls.empty()) return {};
  constexpr double inf = std::numeric_limits<double>::infinity();
  ViewRectangle rectangle{inf, -inf, inf, -inf};
  for (const Ball& ball : balls) {
    const Eigen::Vector3d c = ball.center_m - eye;
    if (c.z() - ball.radius_m < kNear) return {};
    for (const double z : {c.z() - ball.radius_m, c.z() + ball.radius_m}) {
      rectangle.x_min = std::min(rectangle.x_min, (c.x() - ball.radius_m) / z);
      rectangle.x_max = std::max(rectangle.x_max, (c.x() + ball.radius_m) / z);
      rectangle.y_min = std::min(rectangle.y_min, (c.y() - ball.radius_m) / z);
      rectangle.y_max = std::max(rectangle.y_max, (c.y() + ball.radius_m) / z);
    }
  }
  return rectangle;
}

struct PixelRange {
  int u_begin, u_end, v_begin, v_end;
};

int clamped_px(double px, int size) {
  return static_cast<int>(std::clamp(px, 0.0, static_cast<double>(size)));
}

PixelRange pixel_range(const ViewRectangle& r, const Intrinsics& camera, double margin_px) {
  if (camera.has_distortion()) return {0, camera.width, 0, camera.height};
  const auto u = [&](double x) { return camera.fx_px * x + camera.cx_px; };
  const auto v = [&](double y) { return camera.fy_px * y + camera.cy_px; };
  return {clamped_px(std::floor(u(r.x_min) - margin_px), camera.width),
          clamped_px(std::ceil(u(r.x_max) + margin_px) + 1.0, camera.width),
          clamped_px(std::floor(v(r.y_min) - margin_px), camera.height),
          clamped_px(std::ceil(v(r.y_max) + margin_px) + 1.0, camera.height)};
}

}  // namespace

CastImage cast_image(const std::vector<Primitive>& primitives, const Intrinsics& camera,
                     const std::vector<Eigen::Vector2d>& rays, double stray_px) {
  CastImage image;
  image.depth_m.assign(rays.size(), std::numeric_limits<double>::infinity());
  image.primitive.assign(rays.size(), -1);
  const auto width = static_cast<std::size_t>(camera.width);
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    const PixelRange range =
        pixel_range(view_rectangle(primitives[i], Eigen::Vector3d::Zero()), camera, stray_px + 1.0);
    const auto cast = [&](const auto& shape) {
      for (int v = range.v_begin; v < range.v_end; ++v) {
        for (int u = range.u_begin; u < range.u_end; ++u) {
          const std::size_t pixel = static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u);
          const double t = first_hit(shape, Ray{Eigen::Vector3d::Zero(), rays[pixel].homogeneous()});
          if (t >= image.depth_m[pixel]) continue;
          image.depth_m[pixel] = t;
          image.primitive[pixel] = static_cast<int>(i);
        }
      }
    };
    std::visit(cast, primitives[i].shape);
  }
  return image;
}

std::vector<unsigned char> shadow_mask(const std::vector<Primitive>& primitives,
                                       const std::vector<Eigen::Vector2d>& rays, const CastImage& hits,
                                       const Eigen::Vector3d& projector_m) {
  std::vector<unsigned char> shadow(rays.size(), 0);
  for (const Primitive& primitive : primitives) {
    const ViewRectangle rectangle = view_rectangle(primitive, projector_m);
    const auto cast = [&](const auto& shape) {
      for (std::size_t pixel = 0; pixel < rays.size(); ++pixel) {
        if (shadow[pixel] != 0 || hits.primitive[pixel] < 0) continue;
        const Eigen::Vector3d to = hits.depth_m[pixel] * rays[pixel].homogeneous() - projector_m;
        if (!rectangle.holds(to.x() / to.z(), to.y() / to.z())) continue;
        // The lit point itself is met at t = 1.
        if (first_hit(shape, Ray{projector_m, to}) < 1.0 - 1e-6) shadow[pixel] = 1;
      }
    };
    std::visit(cast, primitive.shape);
  }
  return shadow;
}

}  // namespace tubetrack
