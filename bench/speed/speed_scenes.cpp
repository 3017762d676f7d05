#include "speed_scenes.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <thread>

#include "scene_parts.hpp"
#include "statistics.hpp"

namespace tubetrack::bench {

namespace {

using Eigen::Vector3d;

constexpr double kDepth_m = 0.8;

Solid wall() {
  return {PlaneShape{{0.0, 0.0, 1.3}, {0.1, 0.05, -1.0}}, {}};
}

SceneTube bent_tube() {
  SceneTube tube;
  tube.radius_m = 0.020;
  tube.start_m = {-0.20, -0.06, kDepth_m};
  tube.direction = Vector3d(1.0, 0.1, 0.1).normalized();
  tube.bend_direction = Vector3d::UnitY();
  tube.parts = {TubePart::straight(0.15), TubePart::arc(0.10, radians(60.0)), TubePart::straight(0.15)};
  return tube;
}

void move(SceneTube& tube, const Eigen::Isometry3d& by) {
  tube.start_m = by * tube.start_m;
  tube.direction = by.linear() * tube.direction;
  tube.bend_direction = by.linear() * tube.bend_direction;
}

/// As one that looks down by 45° from 0.8 m away has it.
Table table() {
  const double half = std::sqrt(0.5);
  return {{0.0, 0.0, kDepth_m}, Vector3d::UnitX(), {0.0, -half, half}, {0.0, -half, -half}};
}

Solid box_on(const Table& top, double right_m, double away_m) {
  const Vector3d size{0.12, 0.08, 0.06};
  return {BoxShape{top.at(right_m, away_m, 0.5 * size.z()), size, top.upright(0.4)}, {}};
}

}  // namespace

Intrinsics speed_camera(int width, int height) {
  const double focal_px = 570.0 * width / 640.0;
  return {width, height, focal_px, focal_px, 0.5 * (width - 1), 0.5 * (height - 1), {}};
}

DepthNoise speed_noise(const Intrinsics& camera) {
  DepthNoise noise;
  noise.sensor.baseline_focal_m_px *= camera.width / 640.0;
  return noise;
}

SpeedScene still_scene() {
  SpeedScene out{"still", "one bent tube of radius 20 mm before a wall, nothing moves", {}, {}};
  out.scene.camera = speed_camera();
  out.scene.tubes = {bent_tube()};
  out.scene.solids = {wall()};
  return out;
}

SpeedScene moving_tube_scene(int width, int height) {
  SpeedScene out = still_scene();
  out.name = "moving tube";
  out.shows = "the same tube, swinging by 0.3 m (0.24 m/s at most) and by 20°";
  out.scene.camera = speed_camera(width, height);
  out.place = [](int k, int count, Scene& scene) {
    const double way = swing(k, count) - 0.5;
    const Vector3d middle{0.0, 0.0, kDepth_m};
    Eigen::Isometry3d by = Eigen::Isometry3d::Identity();
    by.translate(Vector3d(middle + Vector3d(0.30 * way, 0.04 * way, 0.0)));
    by.rotate(Eigen::AngleAxisd(radians(20.0) * way, Vector3d(0.2, 0.1, 1.0).normalized()));
    by.translate(-middle);
    move(scene.tubes[0], by);
  };
  return out;
}

SpeedScene moving_camera_scene() {
  SpeedScene out{"moving camera", "a tube and a box on a table, the camera swinging by 0.25 m, poses given", {}, {}};
  const Table top = table();
  out.scene.camera = speed_camera();
  out.scene.tubes = {straight_tube(0.020, top.at(0.0, -0.03, 0.020), top.right + 0.2 * top.away, 0.38)};
  out.scene.solids = {{PlaneShape{top.origin_m, top.up}, {}}, box_on(top, 0.10, 0.16)};
  out.place = [](int k, int count, Scene& scene) {
    const double way = swing(k, count) - 0.5;
    scene.camera_path = {{0.0, {0.25 * way, 0.04 * way, 0.05 * way}, {0.0, 0.0, kDepth_m}}};
  };
  out.place(0, 1, out.scene);
  return out;
}

SpeedScene three_tubes_scene() {
  SpeedScene out{"three tubes", "radius 12.5, 18 and 25 mm, crossing one behind the other, nothing moves", {}, {}};
  out.scene.camera = speed_camera();
  out.scene.tubes = {straight_tube(0.0125, {0.0, 0.0, 0.72}, heading(radians(10.0), 0.0), 0.45),
                     straight_tube(0.018, {0.08, 0.0, 0.80}, heading(radians(75.0), 0.1), 0.40),
                     straight_tube(0.025, {-0.10, 0.0, 0.88}, heading(radians(120.0), -0.1), 0.45)};
  out.scene.solids = {wall()};
  return out;
}

SpeedScene no_tube_scene() {
  SpeedScene out{"no tube", "a box, a ball and a bowl on a table, nothing moves", {}, {}};
  const Table top = table();
  out.scene.camera = speed_camera();
  out.scene.solids = {{PlaneShape{top.origin_m, top.up}, {}},
                      box_on(top, 0.10, 0.16),
                      {SphereShape{top.at(-0.15, 0.05, 0.05), 0.05}, {}},
                      {BowlShape{top.at(0.16, -0.08, 0.08), top.up, 0.08}, {}}};
  return out;
}

SpeedScene many_tubes_scene(int tubes) {
  SpeedScene out{std::to_string(tubes) + (tubes == 1 ? " tube" : " tubes"),
                 "radius 12 mm, side by side, swinging by 60 mm",
                 {},
                 {}};
  out.scene.camera = speed_camera();
  for (int i = 0; i < tubes; ++i) {
    const double aside_m = 0.050 * (i - 0.5 * (tubes - 1));
    out.scene.tubes.push_back(straight_tube(0.012, {aside_m, 0.0, kDepth_m}, Vector3d::UnitY(), 0.35));
  }
  out.scene.solids = {wall()};
  out.place = [](int k, int count, Scene& scene) {
    for (SceneTube& tube : scene.tubes) tube.start_m.x() += 0.06 * (swing(k, count) - 0.5);
  };
  return out;
}

SpeedScene changing_scene(double share) {
  SpeedScene out = still_scene();
  out.name = "board";
  out.shows = "the tube at rest, and a board behind it that jumps";
  if (share <= 0.0) return out;
  const Intrinsics& camera = out.scene.camera;
  const double depth_m = 1.05;
  const double image_m = depth_m * camera.height / camera.fy_px;
  const double high_m = image_m * (share + 0.1);  // a tenth of the image hangs out of view below
  const double low_m = 0.5 * image_m + 0.1 * image_m;
  const BoxShape board{{0.0, low_m - 0.5 * high_m, depth_m}, {1.5, high_m, 0.001}, Eigen::Quaterniond::Identity()};
  out.scene.solids.push_back({board, {}});
  out.place = [](int k, int, Scene& scene) {
    std::get<BoxShape>(scene.solids.back().shape).center_m.z() += k % 2 == 0 ? -0.03 : 0.03;
  };
  return out;
}

Scene scene_at(const SpeedScene& speed, int k, int count) {
  Scene now = speed.scene;
  if (speed.place) speed.place(k, count, now);
  return now;
}

std::vector<RenderedFrame> render_all(const SpeedScene& speed, int count) {
  if (const auto valid = validate(scene_at(speed, 0, count)); !valid) throw std::logic_error(valid.error().message);
  const DepthNoise noise = speed_noise(speed.scene.camera);
  std::vector<RenderedFrame> frames(static_cast<std::size_t>(count));
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int k = next++; k < count; k = next++) {
      frames[static_cast<std::size_t>(k)] = render_frame(scene_at(speed, k, count), k, noise);
    }
  };
  std::vector<std::jthread> workers(std::max(1U, std::thread::hardware_concurrency()));
  for (std::jthread& worker : workers) worker = std::jthread(work);
  workers.clear();
  return frames;
}

DepthFrame played_frame(const std::vector<RenderedFrame>& frames, int i) {
  DepthFrame frame = depth_frame(frames[static_cast<std::size_t>(there_and_back(i, static_cast<int>(frames.size())))]);
  frame.index = i;
  frame.timestamp_s = i / 30.0;
  return frame;
}

}  // namespace tubetrack::bench
