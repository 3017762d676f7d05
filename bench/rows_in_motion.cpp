#include <algorithm>

#include "row_scenes.hpp"
#include "scene_parts.hpp"

namespace tubetrack::bench {

using Eigen::Vector3d;

SuiteScene moving_tube_scene(Dice& dice) {
  SuiteScene out;
  const double radius_m = usual_radius_m(dice);
  const double depth_m = usual_depth_m(dice) - 0.02;
  const SceneTube tube = draw_until(
      [&] {
        SceneTube candidate = random_straight(dice, radius_m, depth_m);
        Motion& motion = candidate.motion;
        motion.velocity_m_s = dice.uniform(0.2, 0.5) *
                              heading(dice.uniform(0.0, 2.0 * std::numbers::pi), radians(dice.uniform(-20.0, 20.0)));
        motion.angular_velocity_rad_s = dice.uniform(0.0, 0.5) * dice.direction();
        motion.center_m = candidate.start_m + 0.5 * candidate.parts[0].length_m * candidate.direction;
        candidate.start_m -= 0.5 * motion.velocity_m_s;  // in the middle of its way at 0.5 s
        motion.center_m -= 0.5 * motion.velocity_m_s;
        return candidate;
      },
      [&](const SceneTube& candidate) {
        return partly_in_view(candidate, out.scene.camera, 0.0) && partly_in_view(candidate, out.scene.camera, 0.5) &&
               partly_in_view(candidate, out.scene.camera, 1.0);
      });
  out.scene.tubes = {tube};
  out.scene.solids = {random_wall(dice)};
  out.single_frame = 15;
  return out;
}

SuiteScene drift_scene(Dice& dice) {
  SuiteScene out = straight_scene(dice);
  out.scene.tubes[0].motion.velocity_m_s = 0.001 * dice.direction();
  return out;
}

/// Two tubes; the one at the right or left edge leaves at 0.5 m/s, is away for a third of a second, and comes back.
SuiteScene leaving_scene(Dice& dice) {
  SuiteScene out;
  const double side = dice.sign();
  const double depth_m = 0.78;
  const double stays_m = dice.uniform(0.018, 0.025);
  const double leaves_m = dice.uniform(0.012, 0.8 * stays_m);
  const auto upright = [&] { return heading(radians(dice.uniform(84.0, 96.0)), radians(dice.uniform(-8.0, 8.0))); };
  out.scene.tubes = {
      straight_tube(leaves_m, {side * 0.35, 0.0, depth_m}, upright(), dice.uniform(0.30, 0.40)),
      straight_tube(stays_m, {side * dice.uniform(-0.15, 0.0), 0.0, depth_m}, upright(), dice.uniform(0.30, 0.40))};
  out.scene.solids = {random_wall(dice)};
  const Vector3d home = out.scene.tubes[0].start_m;
  out.place = [home, side](int frame, Scene& scene) {
    const int out_frames = std::clamp(frame - 8, 0, 10);
    const int back_frames = std::clamp(frame - 28, 0, 10);
    scene.tubes[0].start_m = home + Vector3d(side * 0.5 / 30.0 * (out_frames - back_frames), 0.0, 0.0);
  };
  return out;
}

SuiteScene hand_scene(Dice& dice) {
  SuiteScene out = dice.chance(0.5) ? straight_scene(dice) : bent_scene(dice);
  const double side = dice.sign();
  Motion motion;
  motion.velocity_m_s = {-side * dice.uniform(0.6, 0.8), dice.uniform(-0.05, 0.05), 0.0};
  const Vector3d wrist{side * 0.40, dice.uniform(0.08, 0.16), dice.uniform(0.50, 0.56)};
  motion.center_m = wrist;
  motion.angular_velocity_rad_s = {0.0, 0.0, dice.uniform(-0.15, 0.15)};
  for (const Solid& part : random_hand(dice, wrist, motion)) out.scene.solids.push_back(part);
  out.single_frame = 15;
  return out;
}

SuiteScene moving_camera_scene(Dice& dice) {
  SuiteScene out;
  const Table table = random_table(dice, 0.78);
  const double thick_m = dice.uniform(0.018, 0.024);
  const double thin_m = dice.uniform(0.014, 0.018);
  const double turn = radians(dice.uniform(-15.0, 15.0));
  const Vector3d along = std::cos(turn) * table.right + std::sin(turn) * table.away;
  SceneTube bent = straight_tube(thin_m, table.at(0.0, -0.10, thin_m), table.right, 0.0);
  bent.start_m = table.at(-0.20, -0.13, thin_m);
  bent.bend_direction = table.away;
  bent.parts = {TubePart::straight(dice.uniform(0.14, 0.20)),
                TubePart::arc(dice.uniform(5.0, 8.0) * thin_m, radians(dice.uniform(45.0, 80.0))),
                TubePart::straight(dice.uniform(0.08, 0.12))};
  out.scene.tubes = {
      straight_tube(thick_m, table.at(dice.uniform(-0.10, -0.05), 0.14, thick_m), along, dice.uniform(0.30, 0.40)),
      bent};
  out.scene.solids = {table.top()};
  const auto about = [&](double reach_m) {
    return Vector3d(dice.uniform(-reach_m, reach_m), dice.uniform(-reach_m, reach_m),
                    dice.uniform(-0.5 * reach_m, 0.5 * reach_m));
  };
  const double side = dice.sign();
  for (int i = 0; i < 4; ++i) {
    const Vector3d position = Vector3d(side * (-0.15 + 0.10 * i), 0.0, 0.0) + about(0.04);
    out.scene.camera_path.push_back({i / 3.0, position, table.origin_m + about(0.02)});
  }
  out.single_frame = 15;
  return out;
}

SuiteScene pose_errors_scene(Dice& dice) {
  SuiteScene out = moving_camera_scene(dice);
  out.pose_errors = true;
  return out;
}

}  // namespace tubetrack::bench
