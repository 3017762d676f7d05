#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "tubetrack/replay/synthetic_scene.hpp"
#include "tubetrack/replay/tube_path.hpp"

namespace tubetrack {

namespace {

using Problem = std::optional<std::string>;
using Eigen::Vector3d;

std::string refusal(const std::string& field, double got, const char* takes) {
  return fmt::format("{}: got {:g}, takes {}", field, got, takes);
}

Problem length(const std::string& field, double value_m) {
  if (std::isfinite(value_m) && value_m > 0.0 && value_m <= 100.0) return {};
  return refusal(field, value_m, "metres above 0, at most 100");
}

Problem finite(const std::string& field, const Vector3d& value) {
  if (value.allFinite()) return {};
  return fmt::format("{}: takes three finite numbers", field);
}

Problem direction(const std::string& field, const Vector3d& value) {
  if (value.allFinite() && value.norm() > 1e-9) return {};
  return fmt::format("{}: got [{:g}, {:g}, {:g}], takes a direction of any length above 0", field, value.x(), value.y(),
                     value.z());
}

Problem motion(const std::string& field, const Motion& value) {
  if (auto problem = finite(field + ".velocity_m_s", value.velocity_m_s)) return problem;
  if (auto problem = finite(field + ".angular_velocity_rad_s", value.angular_velocity_rad_s)) return problem;
  return finite(field + ".center_m", value.center_m);
}

Problem tube_part(const std::string& field, const TubePart& part, double radius_m) {
  if (part.type == TubePart::Type::straight) return length(field + ".length_m", part.length_m);
  if (auto problem = length(field + ".bend_radius_m", part.bend_radius_m)) return problem;
  if (part.bend_radius_m <= radius_m) {
    return refusal(field + ".bend_radius_m", part.bend_radius_m, "more than the tube's radius_m");
  }
  if (!(part.angle_rad > 0.0 && part.angle_rad < 2.0 * std::numbers::pi)) {
    return refusal(field + ".angle_rad", part.angle_rad, "radians above 0, below 2 pi");
  }
  if (!std::isfinite(part.rotation_rad)) return refusal(field + ".rotation_rad", part.rotation_rad, "radians");
  return {};
}

Problem radius_profile(const std::string& field, const std::vector<RadiusKey>& keys) {
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string key = fmt::format("{}[{}]", field, i);
    if (auto problem = length(key + ".radius_m", keys[i].radius_m)) return problem;
    if (!std::isfinite(keys[i].at_m)) return refusal(key + ".at_m", keys[i].at_m, "metres along the tube");
    if (i > 0 && keys[i].at_m <= keys[i - 1].at_m)
      return refusal(key + ".at_m", keys[i].at_m, "more than the key before");
  }
  return {};
}

Problem scene_tube(const std::string& field, const SceneTube& tube) {
  if (tube.radius_profile.empty()) {
    if (auto problem = length(field + ".radius_m", tube.radius_m)) return problem;
  } else if (auto problem = radius_profile(field + ".radius_profile", tube.radius_profile)) {
    return problem;
  }
  if (auto problem = finite(field + ".start_m", tube.start_m)) return problem;
  if (auto problem = direction(field + ".direction", tube.direction)) return problem;
  if (auto problem = direction(field + ".bend_direction", tube.bend_direction)) return problem;
  if (tube.bend_direction.normalized().cross(tube.direction.normalized()).norm() < 1e-6) {
    return fmt::format("{}.bend_direction: is parallel to direction, takes one across it", field);
  }
  if (tube.parts.empty()) return fmt::format("{}.parts: is empty, takes at least one straight or arc", field);
  for (std::size_t i = 0; i < tube.parts.size(); ++i) {
    if (auto problem = tube_part(fmt::format("{}.parts[{}]", field, i), tube.parts[i], largest_radius_m(tube)))
      return problem;
  }
  return motion(field + ".motion", tube.motion);
}

Problem from_to(const std::string& field, const Vector3d& from, const Vector3d& to) {
  if (auto problem = finite(field + ".from_m", from)) return problem;
  if (auto problem = finite(field + ".to_m", to)) return problem;
  if ((to - from).norm() < 1e-6) return fmt::format("{}.to_m: is the same point as from_m, takes another", field);
  return {};
}

struct ShapeProblem {
  const std::string& field;

  Problem operator()(const PlaneShape& plane) const {
    if (auto problem = finite(field + ".point_m", plane.point_m)) return problem;
    return direction(field + ".normal", plane.normal);
  }
  Problem operator()(const BoxShape& box) const {
    if (auto problem = finite(field + ".center_m", box.center_m)) return problem;
    for (int i = 0; i < 3; ++i) {
      if (auto problem = length(fmt::format("{}.size_m[{}]", field, i), box.size_m[i])) return problem;
    }
    if (std::isfinite(box.rotation.norm()) && box.rotation.norm() > 1e-9) return {};
    return fmt::format("{}.quaternion_xyzw: takes four finite numbers, not all 0", field);
  }
  Problem operator()(const SphereShape& sphere) const {
    if (auto problem = finite(field + ".center_m", sphere.center_m)) return problem;
    return length(field + ".radius_m", sphere.radius_m);
  }
  Problem operator()(const CapsuleShape& capsule) const {
    if (auto problem = from_to(field, capsule.from_m, capsule.to_m)) return problem;
    return length(field + ".radius_m", capsule.radius_m);
  }
  Problem operator()(const FrustumShape& frustum) const {
    if (auto problem = from_to(field, frustum.from_m, frustum.to_m)) return problem;
    if (frustum.from_radius_m != 0.0) {
      if (auto problem = length(field + ".from_radius_m", frustum.from_radius_m)) return problem;
    } else if (frustum.to_radius_m == 0.0) {
      return refusal(field + ".from_radius_m", 0.0, "metres above 0 where to_radius_m is 0");
    }
    return frustum.to_radius_m == 0.0 ? Problem{} : length(field + ".to_radius_m", frustum.to_radius_m);
  }
  Problem operator()(const BowlShape& bowl) const {
    if (auto problem = finite(field + ".center_m", bowl.center_m)) return problem;
    if (auto problem = direction(field + ".opening", bowl.opening)) return problem;
    return length(field + ".radius_m", bowl.radius_m);
  }
};

Problem camera_path(const std::vector<CameraKey>& path) {
  for (std::size_t i = 0; i < path.size(); ++i) {
    const std::string field = fmt::format("camera_path[{}]", i);
    if (!std::isfinite(path[i].time_s)) return refusal(field + ".time_s", path[i].time_s, "seconds");
    if (i > 0 && path[i].time_s <= path[i - 1].time_s) {
      return refusal(field + ".time_s", path[i].time_s, "a time after the key before");
    }
    if (auto problem = finite(field + ".position_m", path[i].position_m)) return problem;
    if (auto problem = finite(field + ".look_at_m", path[i].look_at_m)) return problem;
    const Vector3d forward = path[i].look_at_m - path[i].position_m;
    if (forward.cross(Vector3d::UnitY()).norm() < 1e-6 * std::max(forward.norm(), 1.0)) {
      return fmt::format("{}.look_at_m: lies on position_m or straight above or below it, takes a point aside", field);
    }
  }
  return {};
}

Problem scene_problem(const Scene& scene) {
  if (auto camera = validate(scene.camera); !camera) return "camera." + camera.error().message;
  if (scene.frames < 1 || scene.frames > 1000000) return refusal("frames", scene.frames, "1 to 1000000");
  if (!(scene.frames_per_second >= 0.001 && scene.frames_per_second <= 10000.0)) {
    return refusal("frames_per_second", scene.frames_per_second, "0.001 to 10000");
  }
  for (std::size_t i = 0; i < scene.tubes.size(); ++i) {
    if (auto problem = scene_tube(fmt::format("tubes[{}]", i), scene.tubes[i])) return problem;
  }
  for (std::size_t i = 0; i < scene.solids.size(); ++i) {
    const std::string field = fmt::format("solids[{}]", i);
    if (auto problem = std::visit(ShapeProblem{field}, scene.solids[i].shape)) return problem;
    if (auto problem = motion(field + ".motion", scene.solids[i].motion)) return problem;
  }
  if (scene.tubes.empty() && scene.solids.empty()) return "solids: is empty, and so is tubes; takes something to see";
  return camera_path(scene.camera_path);
}

}  // namespace

Expected<void> validate(const Scene& scene) {
  if (auto problem = scene_problem(scene)) return tl::make_unexpected(Error::usage(*problem));
  return {};
}

}  // namespace tubetrack
