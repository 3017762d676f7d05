#include "ray_cast.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "replay/scene_oracle.hpp"
#include "tubetrack/replay/render.hpp"
#include "tubetrack/replay/tube_path.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;
using test::CenterlineDistance;
using test::distance_to_centerline;
using test::inside_scene;

class PresetRayCast : public ::testing::TestWithParam<const char*> {};

/// Ways from the camera to the first point of a 1 mm walk that is inside something, narrowed by bisection.
double walked_depth(const Scene& scene, int frame, const Eigen::Isometry3d& world_from_camera, const Vector3d& ray) {
  const double time_s = frame_time_s(scene, frame);
  const double step = 0.001;
  for (double z = 0.3; z < 3.7; z += step) {
    if (!inside_scene(scene, time_s, world_from_camera * (z * ray))) continue;
    double outside = z - step;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (outside + z);
      (inside_scene(scene, time_s, world_from_camera * (middle * ray)) ? z : outside) = middle;
    }
    return z;
  }
  return std::numeric_limits<double>::infinity();
}

TEST_P(PresetRayCast, EveryPixelIsTheFirstPointOfAWalkAlongItsRay) {
  Scene scene = preset_scene(GetParam()).value();
  // The oracle knows no thin shells.
  std::erase_if(scene.solids, [](const Solid& solid) { return std::holds_alternative<BowlShape>(solid.shape); });
  const int frame = 12;
  const ExactImage image = exact_image(scene, frame);
  const Eigen::Isometry3d pose = world_from_camera(scene, frame);
  int skipped = 0;
  int checked = 0;
  for (int v = 3; v < 480; v += 23) {
    for (int u = 2; u < 640; u += 19, ++checked) {
      const Vector3d ray = normalized_ray(scene.camera, u, v).homogeneous();
      const double cast = image.depth_m[static_cast<std::size_t>(v * 640 + u)];
      const double walked = walked_depth(scene, frame, pose, ray);
      if (std::isinf(cast) && std::isinf(walked)) continue;
      // The walk can step over a corner that the ray cuts by less than its step, never the other way round.
      if (cast < walked - 1e-6 && !inside_scene(scene, frame_time_s(scene, frame), pose * ((cast + 0.0005) * ray))) {
        ++skipped;
        continue;
      }
      ASSERT_NEAR(cast, walked, 1e-7) << "pixel " << u << ", " << v;
    }
  }
  EXPECT_LE(skipped, checked / 250);
}

TEST_P(PresetRayCast, TubePixelsLieOnTheTubesWallOrCap) {
  const Scene scene = preset_scene(GetParam()).value();
  const int frame = 7;
  const ExactImage image = exact_image(scene, frame);
  const Eigen::Isometry3d pose = world_from_camera(scene, frame);
  std::vector<int> seen(scene.tubes.size(), 0);
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const auto pixel = static_cast<std::size_t>(v * 640 + u);
      const int object = image.object[pixel];
      if (object < 0 || object >= static_cast<int>(scene.tubes.size())) continue;
      const auto index = static_cast<std::size_t>(object);
      const SceneTube& tube = scene.tubes[index];
      const Vector3d in_world = pose * (image.depth_m[pixel] * normalized_ray(scene.camera, u, v).homogeneous());
      const Vector3d p = motion_at(tube.motion, frame_time_s(scene, frame)).inverse() * in_world;
      const CenterlineDistance to = distance_to_centerline(tube, p);
      const bool on_wall = std::abs(to.distance_m - tube.radius_m) < 1e-9 && to.beyond_cap_m < 1e-9;
      const bool on_cap = to.distance_m < tube.radius_m && to.beyond_cap_m < 1e-9;
      // Deep inside is a cap only where the tube ends.
      const Vector3d inward =
          p +
          1e-6 * (p - motion_at(tube.motion, frame_time_s(scene, frame)).inverse() * pose.translation()).normalized();
      const Vector3d outward = 2.0 * p - inward;
      const auto within = [&](const Vector3d& q) {
        const CenterlineDistance d = distance_to_centerline(tube, q);
        return d.beside && d.distance_m <= tube.radius_m;
      };
      ASSERT_TRUE(on_wall || (on_cap && !within(outward) && within(inward)))
          << "pixel " << u << ", " << v << ": " << to.distance_m - tube.radius_m << " m off the wall";
      ++seen[index];
    }
  }
  for (std::size_t i = 0; i < seen.size(); ++i) EXPECT_GT(seen[i], 300) << "tube " << i + 1;
}

INSTANTIATE_TEST_SUITE_P(Presets, PresetRayCast,
                         ::testing::Values("straight", "bent", "crossing", "pile", "moving-tube", "moving-camera",
                                           "hand", "clutter", "far-thick", "near-thin"),
                         [](const auto& preset) {
                           std::string name = preset.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

double torus_distance(const TorusArc& arc, const Vector3d& p) {
  const Vector3d to = p - arc.center_m;
  const double z = to.dot(arc.to_start.cross(arc.tangent));
  const double rho = std::sqrt(std::max(0.0, to.squaredNorm() - z * z));
  return std::hypot(rho - arc.bend_radius_m, z) - arc.radius_m;
}

bool on_arc(const TorusArc& arc, const Vector3d& p, double slack) {
  double angle = std::atan2((p - arc.center_m).dot(arc.tangent), (p - arc.center_m).dot(arc.to_start));
  if (angle < -slack) angle += 2.0 * std::numbers::pi;
  return angle <= arc.angle_rad + slack;
}

TEST(RayCast, TorusArcsOfAnyShapeAreHitWhereAFineWalkChangesSide) {
  std::mt19937_64 bits(7);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(bits() >> 11) * 0x1.0p-53);
  };
  const auto direction = [&] { return Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized(); };
  int hits = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    TorusArc arc;
    arc.center_m = Vector3d(uniform(-0.3, 0.3), uniform(-0.3, 0.3), uniform(0.6, 3.0));
    arc.to_start = direction();
    arc.tangent = arc.to_start.cross(direction()).normalized();
    arc.radius_m = uniform(0.004, 0.1);
    arc.bend_radius_m = arc.radius_m * uniform(1.01, 8.0);
    arc.angle_rad = uniform(0.05, 6.2);
    const double reach = arc.bend_radius_m + arc.radius_m;
    const Vector3d aim = arc.center_m + uniform(0.0, 1.0) * reach * direction();
    const Ray ray{Vector3d::Zero(), aim / aim.z()};
    const double t = first_hit(arc, ray);
    // Walks through the bounding sphere and stops at the first change of side on the arc.
    const double middle = arc.center_m.dot(ray.direction) / ray.direction.squaredNorm();
    const double step = reach / ray.direction.norm() / 2000.0;
    double walked = std::numeric_limits<double>::infinity();
    for (double s = middle - 2001.0 * step; s < middle + 2001.0 * step; s += step) {
      double low = s;
      double high = s + step;
      const bool inside = torus_distance(arc, low * ray.direction) < 0.0;
      if (inside == (torus_distance(arc, high * ray.direction) < 0.0)) continue;
      for (int i = 0; i < 60; ++i) {
        const double half = 0.5 * (low + high);
        ((torus_distance(arc, half * ray.direction) < 0.0) == inside ? low : high) = half;
      }
      if (!on_arc(arc, low * ray.direction, 1e-7)) continue;
      walked = low;
      break;
    }
    if (std::isfinite(t)) {
      ++hits;
      ASSERT_LT(std::abs(torus_distance(arc, t * ray.direction)), 1e-9) << "trial " << trial;
      ASSERT_TRUE(on_arc(arc, t * ray.direction, 1e-7)) << "trial " << trial;
      ASSERT_LE(t, walked + 1e-7) << "trial " << trial;
    } else {
      ASSERT_TRUE(std::isinf(walked)) << "trial " << trial << " misses " << walked;
    }
  }
  EXPECT_GT(hits, 300);
}

TEST(RayCast, ABowlIsSeenInsideAndOutside) {
  const SphereWall bowl{{0.0, 0.0, 1.0}, 0.1, true, -Vector3d::UnitZ()};
  EXPECT_NEAR(first_hit(bowl, Ray{}), 1.1, 1e-12);
  const SphereWall turned{{0.0, 0.0, 1.0}, 0.1, true, Vector3d::UnitZ()};
  EXPECT_NEAR(first_hit(turned, Ray{}), 0.9, 1e-12);
}

TEST(RayCast, IncidenceIsTheAngleBetweenRayAndNormal) {
  Scene scene;
  scene.solids = {{PlaneShape{{0.0, 0.0, 1.0}, {std::sin(1.0), 0.0, -std::cos(1.0)}}, {}}};
  const ExactImage image = exact_image(scene, 0);
  for (const int u : {0, 200, 319, 500}) {
    const Vector3d ray = normalized_ray(scene.camera, u, 100).homogeneous().normalized();
    const double expected = std::acos(std::abs(ray.x() * std::sin(1.0) - ray.z() * std::cos(1.0)));
    const auto pixel = static_cast<std::size_t>(100 * 640 + u);
    if (std::isfinite(image.depth_m[pixel])) {
      EXPECT_NEAR(image.incidence_rad[pixel], expected, 1e-9) << u;
    }
  }
}

TEST(RayCast, DistortedCamerasSeeThePointThatProjectsToThePixel) {
  Scene scene = preset_scene("bent").value();
  scene.camera.distortion = {0.1, -0.2, 0.001, -0.002, 0.05, 0.0, 0.0, 0.0};
  const ExactImage image = exact_image(scene, 0);
  const Vector3d on_axis = scene.tubes[0].start_m + 0.1 * scene.tubes[0].direction.normalized();
  const Eigen::Vector2d pixel = project(scene.camera, on_axis);
  EXPECT_EQ(image.object[static_cast<std::size_t>(std::lround(pixel.y()) * 640 + std::lround(pixel.x()))], 0);
}

// A straight whose radius varies is cast cone by cone, a bend in steps of 1 mm: at a taper of 1 : 8 these are 0.06 mm
// to either side.
TEST(RayCast, TheWallOfATubeOfVaryingRadiusLiesAsFarFromItsAxisAsItShould) {
  Scene scene;
  scene.camera = {160, 120, 140.0, 140.0, 79.5, 59.5, {}};
  SceneTube tube;
  tube.start_m = {-0.2, 0.05, 0.8};
  tube.direction = {1.0, 0.0, 0.1};
  tube.bend_direction = {0.0, -1.0, 0.0};
  tube.parts = {TubePart::straight(0.15), TubePart::arc(0.15, 1.2), TubePart::straight(0.1)};
  tube.radius_profile = {{0.0, 0.02}, {0.08, 0.03}, {0.4, 0.02}};
  scene.tubes = {tube};
  const ExactImage image = exact_image(scene, 0);
  const std::vector<CenterlinePoint> axis = sample_centerline(place_parts(tube), 0.0002);
  int hits = 0;
  for (int v = 0; v < scene.camera.height; ++v) {
    for (int u = 0; u < scene.camera.width; ++u) {
      const auto pixel = static_cast<std::size_t>(v * scene.camera.width + u);
      if (image.object[pixel] < 0) continue;
      const Eigen::Vector3d point = image.depth_m[pixel] * normalized_ray(scene.camera, u, v).homogeneous();
      const auto nearest = std::ranges::min_element(
          axis, {}, [&](const CenterlinePoint& at) { return (at.position_m - point).squaredNorm(); });
      if (nearest == axis.begin() || nearest == axis.end() - 1) continue;  // a cap
      const double radius_m = radius_along_m(tube, 0.0002 * static_cast<double>(nearest - axis.begin()));
      EXPECT_NEAR((nearest->position_m - point).norm(), radius_m, 0.0001) << u << ' ' << v;
      ++hits;
    }
  }
  EXPECT_GT(hits, 400);
}

}  // namespace
}  // namespace tubetrack
