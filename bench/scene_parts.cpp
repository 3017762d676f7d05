#include "scene_parts.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <variant>

#include "tubetrack/replay/tube_path.hpp"

namespace tubetrack::bench {

using Eigen::Vector3d;

namespace {

constexpr double kCourseStep_m = 0.004;

bool within(const Eigen::Vector2d& pixel, const Intrinsics& camera, double margin_px) {
  return pixel.x() > margin_px && pixel.y() > margin_px && pixel.x() < camera.width - 1 - margin_px &&
         pixel.y() < camera.height - 1 - margin_px;
}

/// A stretch in front of another one: more than five radii apart along the tube and less than 2.4 in the image.
bool covers_itself(const std::vector<Vector3d>& points, double radius_m) {
  const auto apart = static_cast<std::size_t>(5.0 * radius_m / kCourseStep_m) + 1;
  for (std::size_t i = 0; i < points.size(); i += 2) {
    for (std::size_t j = i + apart; j < points.size(); j += 2) {
      const double depth_m = std::min(points[i].z(), points[j].z());
      const Eigen::Vector2d between = depth_m * (points[i].hnormalized() - points[j].hnormalized());
      if (between.norm() < 2.4 * radius_m) return true;
    }
  }
  return false;
}

Solid scaled_hand_part(const Solid& part, double scale, const Vector3d& old_wrist, const Vector3d& wrist) {
  const auto place = [&](const Vector3d& point) -> Vector3d { return wrist + scale * (point - old_wrist); };
  Solid moved;
  if (const auto* cone = std::get_if<FrustumShape>(&part.shape)) {
    moved.shape =
        FrustumShape{place(cone->from_m), place(cone->to_m), scale * cone->from_radius_m, scale * cone->to_radius_m};
  } else if (const auto* ball = std::get_if<SphereShape>(&part.shape)) {
    moved.shape = SphereShape{place(ball->center_m), scale * ball->radius_m};
  } else {
    throw std::logic_error("the preset hand has a part that is neither cone nor sphere");
  }
  return moved;
}

}  // namespace

std::vector<Vector3d> course(const SceneTube& tube) {
  std::vector<Vector3d> points;
  for (const CenterlinePoint& sample : sample_centerline(place_parts(tube), kCourseStep_m)) {
    points.push_back(sample.position_m);
  }
  return points;
}

bool in_plain_view(const SceneTube& tube, const Intrinsics& camera, const ViewRules& rules) {
  const std::vector<Vector3d> points = course(tube);
  for (const Vector3d& point : points) {
    if (point.z() < 0.3) return false;
    const double half_px = camera.fx_px * tube.radius_m / point.z();
    if (2.0 * half_px < rules.min_width_px) return false;
    if (!within(project(camera, point), camera, rules.margin_px + half_px)) return false;
  }
  return !covers_itself(points, tube.radius_m);
}

double gap_m(const SceneTube& one, const SceneTube& other) {
  double least = std::numeric_limits<double>::infinity();
  const std::vector<Vector3d> others = course(other);
  for (const Vector3d& a : course(one)) {
    for (const Vector3d& b : others) least = std::min(least, (a - b).norm());
  }
  return least - one.radius_m - other.radius_m;
}

bool partly_in_view(const SceneTube& tube, const Intrinsics& camera, double time_s) {
  const Eigen::Isometry3d now = motion_at(tube.motion, time_s);
  int seen = 0;
  for (const Vector3d& point : course(tube)) {
    const Vector3d moved = now * point;
    if (moved.z() < 0.5 || 2.0 * camera.fx_px * tube.radius_m / moved.z() < 16.0) return false;
    seen += within(project(camera, moved), camera, 0.0) ? 1 : 0;
  }
  return seen * kCourseStep_m > 0.25;
}

SceneTube draw_until(const std::function<SceneTube()>& draw, const std::function<bool(const SceneTube&)>& good) {
  for (int i = 0; i < 200000; ++i) {
    SceneTube tube = draw();
    if (good(tube)) return tube;
  }
  throw std::logic_error("a row of the suite asks for a tube that can't be");
}

SceneTube straight_tube(double radius_m, const Vector3d& middle_m, const Vector3d& direction, double length_m) {
  SceneTube tube;
  tube.radius_m = radius_m;
  tube.direction = direction.normalized();
  tube.start_m = middle_m - 0.5 * length_m * tube.direction;
  tube.bend_direction = tube.direction.unitOrthogonal();
  tube.parts = {TubePart::straight(length_m)};
  return tube;
}

Vector3d heading(double turn_rad, double lean_rad) {
  return {std::cos(turn_rad) * std::cos(lean_rad), std::sin(turn_rad) * std::cos(lean_rad), std::sin(lean_rad)};
}

SceneTube random_straight(Dice& dice, double radius_m, double depth_m, const ViewRules& rules) {
  const Scene scene;
  return draw_until(
      [&] {
        const Vector3d middle{depth_m * dice.uniform(-0.25, 0.25), depth_m * dice.uniform(-0.20, 0.20), depth_m};
        const Vector3d along = heading(dice.uniform(0.0, std::numbers::pi), radians(dice.uniform(-35.0, 35.0)));
        return straight_tube(radius_m, middle, along, dice.uniform(0.30, 0.55));
      },
      [&](const SceneTube& tube) { return in_plain_view(tube, scene.camera, rules); });
}

SceneTube random_bent(Dice& dice, double radius_m, double depth_m) {
  const Scene scene;
  return draw_until(
      [&] {
        SceneTube tube;
        tube.radius_m = radius_m;
        tube.direction = heading(dice.uniform(0.0, 2.0 * std::numbers::pi), radians(dice.uniform(-25.0, 25.0)));
        tube.bend_direction = dice.direction();
        if (tube.direction.cross(tube.bend_direction).norm() < 0.1)
          tube.bend_direction = tube.direction.unitOrthogonal();
        tube.parts = {TubePart::straight(dice.uniform(0.05, 0.18))};
        const int bends = 1 + dice.pick(3);
        for (int i = 0; i < bends; ++i) {
          tube.parts.push_back(TubePart::arc(2.0 * radius_m * dice.uniform(2.5, 6.0),
                                             radians(dice.uniform(45.0, 150.0)),
                                             i == 0 ? 0.0 : radians(dice.uniform(-180.0, 180.0))));
          tube.parts.push_back(TubePart::straight(dice.uniform(0.05, 0.18)));
        }
        const std::vector<Vector3d> points = course(tube);
        const Vector3d& middle = points[points.size() / 2];
        tube.start_m = Vector3d(dice.uniform(-0.15, 0.15), dice.uniform(-0.12, 0.12), depth_m) - middle;
        return tube;
      },
      [&](const SceneTube& tube) {
        return total_length_m(place_parts(tube)) >= 0.3 && in_plain_view(tube, scene.camera, {});
      });
}

double usual_radius_m(Dice& dice) {
  return dice.uniform(0.012, 0.025);
}

double usual_depth_m(Dice& dice) {
  return dice.uniform(0.72, 0.82);
}

Solid random_wall(Dice& dice, double from_m, double to_m) {
  const Vector3d normal = -heading(dice.uniform(0.0, 2.0 * std::numbers::pi), radians(dice.uniform(80.0, 90.0)));
  return {PlaneShape{{0.0, 0.0, dice.uniform(from_m, to_m)}, normal}, {}};
}

Eigen::Quaterniond Table::upright(double turn_rad) const {
  Eigen::Matrix3d axes;
  axes << right, away, up;
  return Eigen::Quaterniond(axes * Eigen::AngleAxisd(turn_rad, Vector3d::UnitZ()).toRotationMatrix());
}

Table random_table(Dice& dice, double depth_m) {
  const double pitch = radians(dice.uniform(35.0, 60.0));
  const double roll = radians(dice.uniform(-5.0, 5.0));
  Table table;
  table.origin_m = {dice.uniform(-0.03, 0.03), dice.uniform(-0.03, 0.03), depth_m};
  table.right = {std::cos(roll), std::sin(roll), 0.0};
  table.up = Vector3d(std::sin(roll) * std::cos(pitch), -std::cos(roll) * std::cos(pitch), -std::sin(pitch));
  table.away = table.up.cross(table.right);
  return table;
}

std::vector<Solid> random_hand(Dice& dice, const Vector3d& wrist_m, const Motion& motion) {
  const auto preset = preset_scene("hand");
  if (!preset) throw std::logic_error(preset.error().message);
  const Vector3d old_wrist{-0.40, 0.12, 0.62};
  const double scale = dice.uniform(0.9, 1.1);
  std::vector<Solid> hand;
  for (const Solid& part : preset->solids) {
    if (std::holds_alternative<PlaneShape>(part.shape)) continue;
    hand.push_back(scaled_hand_part(part, scale, old_wrist, wrist_m));
    hand.back().motion = motion;
  }
  return hand;
}

}  // namespace tubetrack::bench
