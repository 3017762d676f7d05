#include <algorithm>

#include "row_scenes.hpp"
#include "scene_parts.hpp"

namespace tubetrack::bench {

using Eigen::Vector3d;

namespace {

SuiteScene before_a_wall(Dice& dice, std::vector<SceneTube> tubes) {
  SuiteScene out;
  out.scene.tubes = std::move(tubes);
  out.scene.solids = {random_wall(dice)};
  return out;
}

bool clear_of(const SceneTube& tube, const std::vector<SceneTube>& others, double least_gap_m) {
  return std::all_of(others.begin(), others.end(),
                     [&](const SceneTube& other) { return gap_m(tube, other) >= least_gap_m; });
}

/// Two or three alike, side by side in the image, `gap_m` between their surfaces.
SuiteScene side_by_side(Dice& dice, double gap_in_diameters) {
  const Scene scene;
  const double radius_m = usual_radius_m(dice);
  const double depth_m = usual_depth_m(dice);
  const int count = 2 + dice.pick(2);
  const double pitch_m = 2.0 * radius_m * (1.0 + gap_in_diameters);
  std::vector<SceneTube> tubes;
  draw_until(
      [&] {
        const Vector3d along = heading(dice.uniform(0.0, std::numbers::pi), radians(dice.uniform(-25.0, 25.0)));
        const Vector3d aside = along.cross(Vector3d::UnitZ()).normalized();
        const Vector3d middle{dice.uniform(-0.08, 0.08), dice.uniform(-0.06, 0.06), depth_m};
        const double length_m = dice.uniform(0.30, 0.45);
        tubes.clear();
        for (int i = 0; i < count; ++i) {
          const Vector3d shifted =
              middle + (i - 0.5 * (count - 1)) * pitch_m * aside + dice.uniform(-0.02, 0.02) * along;
          tubes.push_back(straight_tube(radius_m, shifted, along, length_m));
        }
        return tubes.front();
      },
      [&](const SceneTube& first) {
        return in_plain_view(first, scene.camera, {}) && in_plain_view(tubes.back(), scene.camera, {});
      });
  return before_a_wall(dice, tubes);
}

/// Lying on the table across its depth, side by side, some touching; gives back how high they reach.
double first_layer(Dice& dice, const Table& table, std::vector<SceneTube>& tubes) {
  const int count = 3 + dice.pick(2);
  const double turn = radians(dice.uniform(-15.0, 15.0));
  const Vector3d along = std::cos(turn) * table.away + std::sin(turn) * table.right;
  const Vector3d aside = std::cos(turn) * table.right - std::sin(turn) * table.away;
  double right_m = -0.15;
  double top_m = 0.0;
  double last_radius_m = 0.0;
  for (int i = 0; i < count; ++i) {
    const double radius_m = dice.uniform(0.015, 0.025);
    // Tubes that lie on one plane touch when their axes are 2√(r1 r2) apart.
    if (i > 0)
      right_m += 2.0 * std::sqrt(last_radius_m * radius_m) + (dice.chance(0.4) ? 0.0 : dice.uniform(0.01, 0.05));
    const Vector3d middle = table.origin_m + right_m * aside + dice.uniform(-0.03, 0.03) * along + radius_m * table.up;
    tubes.push_back(straight_tube(radius_m, middle, along, dice.uniform(0.30, 0.36)));
    last_radius_m = radius_m;
    top_m = std::max(top_m, 2.0 * radius_m);
  }
  return top_m;
}

}  // namespace

SuiteScene straight_scene(Dice& dice) {
  return before_a_wall(dice, {random_straight(dice, usual_radius_m(dice), usual_depth_m(dice))});
}

SuiteScene bent_scene(Dice& dice) {
  return before_a_wall(dice, {random_bent(dice, usual_radius_m(dice), usual_depth_m(dice))});
}

SuiteScene crossing_scene(Dice& dice) {
  const Scene scene;
  std::vector<SceneTube> tubes;
  const double first_turn = dice.uniform(0.0, std::numbers::pi);
  for (int i = 0; i < 3; ++i) {
    const double turn = first_turn + radians(60.0 * i + dice.uniform(-15.0, 15.0));
    const double radius_m = usual_radius_m(dice);
    // One behind the other; the thin ones can't be far, or they were less than 16 px wide.
    const double depth_m = std::min(0.68 + 0.07 * i, 2.0 * radius_m * scene.camera.fx_px / 16.0 - 0.03);
    tubes.push_back(draw_until(
        [&] {
          const Vector3d middle{dice.uniform(-0.06, 0.06), dice.uniform(-0.05, 0.05),
                                depth_m + dice.uniform(-0.02, 0.02)};
          return straight_tube(radius_m, middle, heading(turn, radians(dice.uniform(-12.0, 12.0))),
                               dice.uniform(0.35, 0.50));
        },
        [&](const SceneTube& tube) { return in_plain_view(tube, scene.camera, {}); }));
  }
  // Too near to each other: as a whole again.
  for (std::size_t i = 1; i < tubes.size(); ++i) {
    if (!clear_of(tubes[i], {tubes.begin(), tubes.begin() + static_cast<std::ptrdiff_t>(i)}, 0.01)) {
      return crossing_scene(dice);
    }
  }
  return before_a_wall(dice, tubes);
}

SuiteScene parallel_scene(Dice& dice) {
  return side_by_side(dice, 1.0);
}

SuiteScene touching_scene(Dice& dice) {
  return side_by_side(dice, 0.0);
}

SuiteScene pile_scene(Dice& dice) {
  const Table table = random_table(dice, dice.uniform(0.76, 0.84));
  SuiteScene out;
  const double top_m = first_layer(dice, table, out.scene.tubes);
  const int above = 1 + dice.pick(2);
  for (int i = 0; i < above; ++i) {
    const double radius_m = dice.uniform(0.015, 0.025);
    const double turn = radians(dice.uniform(-25.0, 25.0));
    const Vector3d along = std::cos(turn) * table.right + std::sin(turn) * table.away;
    const Vector3d middle = table.at(dice.uniform(-0.04, 0.04),
                                     above == 1 ? dice.uniform(-0.08, 0.08) : -0.09 + 0.18 * i, top_m + radius_m);
    out.scene.tubes.push_back(straight_tube(radius_m, middle, along, dice.uniform(0.30, 0.36)));
  }
  out.scene.solids = {table.top()};
  return out;
}

SuiteScene mixed_radii_scene(Dice& dice) {
  const Scene scene;
  std::vector<double> radii = {dice.uniform(0.010, 0.014), dice.uniform(0.020, 0.040), dice.uniform(0.060, 0.100)};
  for (std::size_t i = radii.size(); i > 1; --i)
    std::swap(radii[i - 1], radii[static_cast<std::size_t>(dice.pick(static_cast<int>(i)))]);
  const double depth_m = 0.80;
  double room_m = 0.60;
  for (const double radius_m : radii) room_m -= 2.0 * radius_m;
  std::vector<SceneTube> tubes;
  double down_m = -0.30;
  for (const double radius_m : radii) {
    down_m += room_m / 6.0 + radius_m;
    const Vector3d middle{dice.uniform(-0.05, 0.05), down_m, depth_m};
    tubes.push_back(straight_tube(radius_m, middle,
                                  heading(radians(dice.uniform(-4.0, 4.0)), radians(dice.uniform(-15.0, 15.0))),
                                  dice.uniform(0.40, 0.60)));
    down_m += radius_m + room_m / 6.0;
  }
  return before_a_wall(dice, tubes);
}

SuiteScene thin_scene(Dice& dice) {
  ViewRules rules;
  rules.min_width_px = 12.0;
  SuiteScene out;
  out.scene.tubes = {draw_until([&] { return random_straight(dice, 0.005, dice.uniform(0.38, 0.42), rules); },
                                [](const SceneTube& tube) {
                                  const auto points = course(tube);
                                  return std::max(points.front().z(), points.back().z()) <= 0.45;
                                })};
  out.scene.solids = {random_wall(dice, 0.60, 0.80)};
  return out;
}

SuiteScene any_tube_scene(Dice& dice) {
  const Scene scene;
  SuiteScene out;
  const double depth_m = dice.uniform(0.55, 1.50);
  const double least_m = std::max(0.008, 16.5 * depth_m / (2.0 * scene.camera.fx_px) * 1.15);
  const double radius_m = least_m * std::pow(0.060 / least_m, dice.uniform(0.0, 1.0));
  const bool bent = dice.chance(0.5) && radius_m < 0.025 && depth_m > 0.65 && depth_m < 1.1;
  out.scene.tubes = {bent ? random_bent(dice, radius_m, depth_m) : random_straight(dice, radius_m, depth_m)};
  out.scene.solids = {random_wall(dice, depth_m + 0.4, depth_m + 0.8)};
  return out;
}

SuiteScene clutter_scene(Dice& dice) {
  const Table table = random_table(dice, dice.uniform(0.80, 0.95));
  SuiteScene out;
  auto& solids = out.scene.solids;
  const auto spot = [&](double up_m) { return table.at(dice.uniform(-0.30, 0.30), dice.uniform(-0.20, 0.20), up_m); };
  const int boxes = 1 + dice.pick(3);
  for (int i = 0; i < boxes; ++i) {
    const Vector3d size{dice.uniform(0.06, 0.22), dice.uniform(0.05, 0.16), dice.uniform(0.02, 0.14)};
    solids.push_back({BoxShape{spot(0.5 * size.z()), size, table.upright(dice.uniform(0.0, std::numbers::pi))}, {}});
  }
  const int balls = 1 + dice.pick(2);
  for (int i = 0; i < balls; ++i) {
    const double radius_m = dice.uniform(0.02, 0.08);
    solids.push_back({SphereShape{spot(radius_m), radius_m}, {}});
  }
  const double bowl_m = dice.uniform(0.06, 0.11);
  solids.push_back({BowlShape{spot(bowl_m), table.up, bowl_m}, {}});
  // A cone or pot that tapers by far more than 5 %.
  const Vector3d foot = spot(0.0);
  solids.push_back({FrustumShape{foot, foot + dice.uniform(0.08, 0.14) * table.up, dice.uniform(0.05, 0.07),
                                 dice.uniform(0.005, 0.03)},
                    {}});
  if (dice.chance(0.5)) {
    for (const Solid& part : random_hand(dice, {dice.uniform(-0.2, 0.2), dice.uniform(0.0, 0.1), 0.60}, {}))
      solids.push_back(part);
  }
  if (dice.chance(0.5)) {  // the table ends in view, with a rim, before a wall corner
    const Vector3d size{0.7, 0.45, dice.uniform(0.01, 0.04)};
    solids.push_back({BoxShape{table.at(0.0, 0.0, -0.5 * size.z()), size, table.upright(0.0)}, {}});
    const Vector3d corner{dice.uniform(-0.3, 0.3), 0.0, 2.0};
    const double turn = radians(dice.uniform(30.0, 60.0));
    solids.push_back({PlaneShape{corner, {std::sin(turn), 0.0, -std::cos(turn)}}, {}});
    solids.push_back({PlaneShape{corner, {-std::cos(turn), 0.0, -std::sin(turn)}}, {}});
  } else {
    solids.push_back(table.top());
  }
  return out;
}

}  // namespace tubetrack::bench
