#include "tubetrack/replay/render.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "measure.hpp"
#include "scene_caster.hpp"
#include "tubetrack/replay/tube_path.hpp"

namespace tubetrack {

namespace {

constexpr double kSampleStep_m = 0.002;
constexpr double kProjectorOffset_m = 0.075;
constexpr int kProfileSteps = 48;

std::vector<Eigen::Vector2d> pixel_rays(const Intrinsics& camera, const DepthNoise* jitter, std::uint64_t seed) {
  std::vector<Eigen::Vector2d> rays;
  rays.reserve(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const PixelJitter off = jitter != nullptr ? pixel_jitter(*jitter, seed, rays.size()) : PixelJitter{};
      rays.push_back(normalized_ray(camera, u + off.u_px, v + off.v_px));
    }
  }
  return rays;
}

std::vector<double> incidences(const std::vector<Primitive>& primitives, const std::vector<Eigen::Vector2d>& rays,
                               const CastImage& hits) {
  std::vector<double> angles(rays.size(), 0.0);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits.primitive[i] < 0) continue;
    const Eigen::Vector3d ray = rays[i].homogeneous();
    const Primitive& primitive = primitives[static_cast<std::size_t>(hits.primitive[i])];
    const double cosine = std::abs(normal_at(primitive.shape, hits.depth_m[i] * ray).dot(ray.normalized()));
    angles[i] = std::acos(std::min(cosine, 1.0));
  }
  return angles;
}

std::vector<int> objects(const std::vector<Primitive>& primitives, const CastImage& hits) {
  std::vector<int> object(hits.primitive.size(), -1);
  for (std::size_t i = 0; i < object.size(); ++i) {
    if (hits.primitive[i] >= 0) object[i] = primitives[static_cast<std::size_t>(hits.primitive[i])].object;
  }
  return object;
}

/// Which surface each pixel's return is of, −1 for none or several; and where it is, without noise.
struct Returns {
  std::vector<int> object;
  std::vector<double> depth_m;
};

/// A sample is visible when at least half of its camera-facing profile has returns of this tube (DESIGN §5).
bool sample_visible(const CenterlinePoint& in_camera, double radius_m, int object, const Intrinsics& camera,
                    const Returns& returns) {
  const Eigen::Vector3d across = in_camera.tangent.unitOrthogonal();
  const Eigen::Vector3d other = in_camera.tangent.cross(across);
  int facing = 0;
  int seen = 0;
  for (int i = 0; i < kProfileSteps; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kProfileSteps;
    const Eigen::Vector3d normal = std::cos(angle) * across + std::sin(angle) * other;
    const Eigen::Vector3d point = in_camera.position_m + radius_m * normal;
    if (normal.dot(point) >= 0.0) continue;
    ++facing;
    if (point.z() <= 0.0) continue;
    const Eigen::Vector2d pixel = project(camera, point);
    if (!(pixel.x() > -0.5 && pixel.y() > -0.5 && pixel.x() < camera.width - 0.5 && pixel.y() < camera.height - 0.5)) {
      continue;
    }
    const auto index = static_cast<std::size_t>(std::lround(pixel.y()) * camera.width + std::lround(pixel.x()));
    // Another stretch of the same tube may lie in front; within a radius it is this one.
    if (returns.object[index] == object && std::abs(returns.depth_m[index] - point.z()) < radius_m) ++seen;
  }
  return facing > 0 && 2 * seen >= facing;
}

TruthFrame truth_of(const Scene& scene, int frame, const Returns& returns) {
  TruthFrame truth;
  truth.frame = frame;
  truth.timestamp_s = frame_time_s(scene, frame);
  truth.frame_id = scene.camera_path.empty() ? "camera" : "world";
  const Eigen::Isometry3d camera_from_world = world_from_camera(scene, frame).inverse();
  for (std::size_t i = 0; i < scene.tubes.size(); ++i) {
    const SceneTube& tube = scene.tubes[i];
    const std::vector<PlacedPart> parts = place_parts(tube);
    const Eigen::Isometry3d now = motion_at(tube.motion, truth.timestamp_s);
    TrueTube out;
    out.id = static_cast<std::int64_t>(i) + 1;
    out.radius_m = mean_radius_m(tube);
    out.length_m = total_length_m(parts);
    for (const TubePart& part : tube.parts) {
      if (part.type != TubePart::Type::arc) continue;
      out.bends.push_back({part.bend_radius_m, part.angle_rad, out.bends.empty() ? 0.0 : part.rotation_rad});
    }
    for (const CenterlinePoint& sample : sample_centerline(parts, kSampleStep_m)) {
      const auto before = static_cast<double>(out.centerline_m.size());
      const double radius_m = radius_along_m(tube, std::min(before * kSampleStep_m, out.length_m));
      if (!tube.radius_profile.empty()) out.node_radius_m.push_back(radius_m);
      const Eigen::Vector3d position = now * sample.position_m;
      const CenterlinePoint in_camera{camera_from_world * position,
                                      camera_from_world.linear() * now.linear() * sample.tangent};
      out.centerline_m.push_back(position);
      out.visible.push_back(sample_visible(in_camera, radius_m, static_cast<int>(i), scene.camera, returns));
    }
    truth.tubes.push_back(std::move(out));
  }
  return truth;
}

std::vector<std::uint16_t> to_units(const std::vector<double>& depth_m, double metres_per_unit) {
  std::vector<std::uint16_t> units(depth_m.size(), 0);
  for (std::size_t i = 0; i < units.size(); ++i) {
    const double value = std::round(depth_m[i] / metres_per_unit);
    if (value >= 1.0 && value <= std::numeric_limits<std::uint16_t>::max()) {
      units[i] = static_cast<std::uint16_t>(value);
    }
  }
  return units;
}

}  // namespace

RenderedFrame render_frame(const Scene& scene, int frame, const DepthNoise& noise) {
  const std::uint64_t seed = seed_of_frame(scene.seed, frame);
  const std::vector<Primitive> primitives = primitives_of(scene, frame);
  std::vector<Eigen::Vector2d> rays = pixel_rays(scene.camera, nullptr, seed);
  CastImage seen = cast_image(primitives, scene.camera, rays, 0.0);
  ExactPixels exact;
  exact.width = scene.camera.width;
  exact.height = scene.camera.height;
  exact.depth_m = seen.depth_m;
  if (noise.jitter) {
    rays = pixel_rays(scene.camera, &noise, seed);
    seen = cast_image(primitives, scene.camera, rays, kMaxJitterSigmas * noise.sensor.lateral_px);
  }
  exact.seen_depth_m = seen.depth_m;
  exact.incidence_rad = incidences(primitives, rays, seen);
  if (noise.shadow) exact.shadow = shadow_mask(primitives, rays, seen, {kProjectorOffset_m, 0.0, 0.0});
  const MeasuredPixels measured = measure(exact, noise, seed);

  RenderedFrame out;
  out.width = scene.camera.width;
  out.height = scene.camera.height;
  out.metres_per_unit = noise.metres_per_unit;
  out.depth = to_units(measured.depth_m, noise.metres_per_unit);
  out.timestamp_s = frame_time_s(scene, frame);
  if (!scene.camera_path.empty()) out.world_from_camera = world_from_camera(scene, frame);
  Returns returns{objects(primitives, seen), seen.depth_m};
  for (std::size_t i = 0; i < out.depth.size(); ++i) {
    if (out.depth[i] == 0 || measured.mixed[i] != 0) returns.object[i] = -1;
  }
  out.truth = truth_of(scene, frame, returns);
  return out;
}

ExactImage exact_image(const Scene& scene, int frame) {
  const std::vector<Primitive> primitives = primitives_of(scene, frame);
  const std::vector<Eigen::Vector2d> rays = pixel_rays(scene.camera, nullptr, 0);
  CastImage hits = cast_image(primitives, scene.camera, rays, 0.0);
  std::vector<double> angles = incidences(primitives, rays, hits);
  std::vector<int> object = objects(primitives, hits);
  return {std::move(hits.depth_m), std::move(angles), std::move(object)};
}

DepthFrame depth_frame(const RenderedFrame& rendered) {
  DepthFrame frame;
  frame.pixels = rendered.depth.data();
  frame.width = rendered.width;
  frame.height = rendered.height;
  frame.stride_bytes = static_cast<std::size_t>(rendered.width) * sizeof(std::uint16_t);
  frame.metres_per_unit = rendered.metres_per_unit;
  frame.timestamp_s = rendered.timestamp_s;
  frame.index = rendered.truth.frame;
  frame.world_from_camera = rendered.world_from_camera;
  return frame;
}

}  // namespace tubetrack
