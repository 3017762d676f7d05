#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <numbers>
#include <vector>

#include "dice.hpp"
#include "tubetrack/replay/synthetic_scene.hpp"

namespace tubetrack::bench {

// What the rows' scenes are put together from. Lengths in metres, x right, y down, z forward.

constexpr double radians(double degrees) {
  return degrees * std::numbers::pi / 180.0;
}

/// Points along the tube's centreline at time 0, 4 mm apart.
std::vector<Eigen::Vector3d> course(const SceneTube& tube);

/// All of the tube in the image, `margin_px` off its border, at least 16 px wide everywhere (`min_width_px`), and no
/// stretch of it in front of another.
struct ViewRules {
  double margin_px = 8.0;
  double min_width_px = 16.0;
};
bool in_plain_view(const SceneTube& tube, const Intrinsics& camera, const ViewRules& rules);

/// Smallest distance between the surfaces of two tubes.
double gap_m(const SceneTube& one, const SceneTube& other);

/// At least 0.25 m of its centreline within the image when the motion has run for `time_s`.
bool partly_in_view(const SceneTube& tube, const Intrinsics& camera, double time_s);

SceneTube straight_tube(double radius_m, const Eigen::Vector3d& middle_m, const Eigen::Vector3d& direction,
                        double length_m);
/// In the image at `turn_rad` to the right (positive: down), leaning away by `lean_rad`.
Eigen::Vector3d heading(double turn_rad, double lean_rad);

/// Any direction in the image, leaning by up to 35°; 0.3 to 0.55 m long, in plain view.
SceneTube random_straight(Dice& dice, double radius_m, double depth_m, const ViewRules& rules = {});
/// One to three bends of 45° to 150°, bend radius 2.5 to 6 diameters, at least 0.3 m long, in plain view.
SceneTube random_bent(Dice& dice, double radius_m, double depth_m);

/// Radius 12 to 25 mm, depth 0.72 to 0.88 m.
double usual_radius_m(Dice& dice);
double usual_depth_m(Dice& dice);

/// Behind everything, leaning by up to 10°.
Solid random_wall(Dice& dice, double from_m = 1.20, double to_m = 1.50);

/// A table top the camera looks down on.
struct Table {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d right, away, up;

  Eigen::Vector3d at(double right_m, double away_m, double up_m) const {
    return origin_m + right_m * right + away_m * away + up_m * up;
  }
  Solid top() const { return {PlaneShape{origin_m, up}, {}}; }
  /// A standing box's rotation.
  Eigen::Quaterniond upright(double turn_rad) const;
};
Table random_table(Dice& dice, double depth_m);

/// The hand of the preset `hand`, 10 % larger or smaller, its wrist at `wrist_m`.
std::vector<Solid> random_hand(Dice& dice, const Eigen::Vector3d& wrist_m, const Motion& motion);

/// Draws until `good`; gives up on a row that can't be built.
SceneTube draw_until(const std::function<SceneTube()>& draw, const std::function<bool(const SceneTube&)>& good);

}  // namespace tubetrack::bench
