#include "suite.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include "row_scenes.hpp"
#include "scene_parts.hpp"

namespace tubetrack::bench {

namespace {

constexpr std::array<Row, 16> kRows{{
    {"straight", "one tube, any direction, leaning by up to 35°", straight_scene},
    {"bent", "one tube with 1–3 bends of 45°–150°, bend radius 2.5–6 diameters", bent_scene},
    {"crossing", "three tubes, one behind the other, crossing in view", crossing_scene},
    {"parallel", "two or three alike, side by side, a diameter between them", parallel_scene},
    {"touching", "two or three alike, side by side, touching", touching_scene},
    {"pile", "four to six tubes on a table, some touching, one or two across the others", pile_scene},
    {"moving-tube", "one tube at 0.2–0.5 m/s, turning", moving_tube_scene, false},
    {"drift", "one tube at 1 mm/s", drift_scene, false},
    {"leaving", "one of two tubes leaves the view and is back within 1 s", leaving_scene, false, 45},
    {"hand", "one tube, a hand passes in front of it", hand_scene, false},
    {"moving-camera", "two tubes on a table, camera in motion, poses exact; in the world frame", moving_camera_scene,
     false},
    {"pose-errors", "the same, every pose 2 mm and 0.2° off", pose_errors_scene, false},
    {"mixed-radii", "radii 10–14, 20–40 and 60–100 mm together at 0.8 m", mixed_radii_scene},
    {"thin", "radius 5 mm, at most 0.45 m away", thin_scene},
    {"clutter", "boxes, spheres, bowls, cones, a hand, a table rim, a wall corner: no tube", clutter_scene, true, 30,
     false},
    {"random", "one tube, radius 8–60 mm, 0.55–1.5 m away: single frames, for the intervals", any_tube_scene, true, 0,
     true, true},
}};

/// 2 mm in one direction, and a turn of 0.2° about another through the camera.
Eigen::Isometry3d pose_error(std::uint64_t seed, int frame) {
  Dice dice("pose error", seed * 1000 + static_cast<std::uint64_t>(frame));
  Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
  error.linear() = Eigen::AngleAxisd(radians(0.2), dice.direction()).toRotationMatrix();
  error.translation() = 0.002 * dice.direction();
  return error;
}

}  // namespace

std::span<const Row> rows() {
  return kRows;
}

SuiteScene make_scene(const Row& row, std::uint64_t seed) {
  // The same scenes with and without pose errors, so that the rows differ by nothing else.
  Dice dice(row.name == "pose-errors" ? "moving-camera" : row.name, seed);
  SuiteScene made = row.make(dice);
  made.scene.name = row.name;
  made.scene.seed = seed;
  made.scene.frames = std::max(row.frames, 1);
  if (const auto valid = validate(made.scene); !valid) {
    throw std::logic_error(std::string(row.name) + ": " + valid.error().message);
  }
  return made;
}

RenderedFrame render(const SuiteScene& suite, int frame, const DepthNoise& noise) {
  RenderedFrame rendered;
  if (suite.place) {
    Scene now = suite.scene;
    suite.place(frame, now);
    rendered = render_frame(now, frame, noise);
  } else {
    rendered = render_frame(suite.scene, frame, noise);
  }
  if (suite.pose_errors && rendered.world_from_camera) {
    rendered.world_from_camera = *rendered.world_from_camera * pose_error(suite.scene.seed, frame);
  }
  return rendered;
}

}  // namespace tubetrack::bench
