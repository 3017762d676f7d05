#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <numbers>

#include "tubetrack/replay/synthetic_scene.hpp"

namespace tubetrack {

namespace {

using Eigen::Vector3d;

constexpr double radians(double degrees) {
  return degrees * std::numbers::pi / 180.0;
}

SceneTube tube(double radius_m, const Vector3d& start_m, const Vector3d& direction, const Vector3d& bend_direction,
               std::vector<TubePart> parts) {
  return {radius_m, start_m, direction, bend_direction, std::move(parts), {}};
}

SceneTube straight_tube(double radius_m, const Vector3d& middle_m, const Vector3d& direction, double length_m) {
  const Vector3d start = middle_m - 0.5 * length_m * direction.normalized();
  return tube(radius_m, start, direction, direction.unitOrthogonal(), {TubePart::straight(length_m)});
}

Solid wall_at(double z_m) {
  return {PlaneShape{{0.0, 0.0, z_m}, -Vector3d::UnitZ()}, {}};
}

/// A table top the camera looks down on at 40°, 0.85 m away in the middle of the view.
struct Table {
  Vector3d origin_m{0.0, 0.0, 0.85};
  Vector3d right = Vector3d::UnitX();
  Vector3d up{0.0, -std::cos(radians(40.0)), -std::sin(radians(40.0))};
  Vector3d away = up.cross(right);

  Vector3d at(double right_m, double away_m, double up_m) const {
    return origin_m + right_m * right + away_m * away + up_m * up;
  }
  Vector3d along(double right_part, double away_part) const { return right_part * right + away_part * away; }
  Solid top() const { return {PlaneShape{origin_m, up}, {}}; }
};

/// Two bends in different planes between three straights.
SceneTube bent_tube() {
  return tube(0.0175, {-0.30, 0.10, 0.84}, {1.0, -0.1, -0.1}, {0.0, -1.0, 0.1},
              {TubePart::straight(0.17), TubePart::arc(0.10, radians(75.0)), TubePart::straight(0.10),
               TubePart::arc(0.09, radians(80.0), radians(150.0)), TubePart::straight(0.18)});
}

Scene straight_scene() {
  Scene scene;
  scene.tubes = {straight_tube(0.020, {0.0, 0.0, 0.80}, {1.0, -0.25, 0.12}, 0.50)};
  scene.solids = {wall_at(1.2)};
  return scene;
}

Scene bent_scene() {
  Scene scene;
  scene.tubes = {bent_tube()};
  scene.solids = {wall_at(1.2)};
  return scene;
}

Scene crossing_scene() {
  Scene scene;
  scene.tubes = {straight_tube(0.0125, {0.0, 0.0, 0.72}, {1.0, 0.35, 0.05}, 0.50),
                 straight_tube(0.0180, {0.02, 0.01, 0.79}, {0.6, -1.0, -0.05}, 0.45),
                 straight_tube(0.0250, {-0.03, 0.03, 0.87}, {1.0, -0.12, 0.08}, 0.60)};
  scene.solids = {wall_at(1.25)};
  return scene;
}

Scene pile_scene() {
  const Table table;
  const double thick = 0.020;
  const double thin = 0.014;
  Scene scene;
  scene.tubes = {// two that touch, and a third in the groove between them
                 straight_tube(thick, table.at(-0.20, 0.0, thick), table.along(0.15, 1.0), 0.40),
                 straight_tube(thick, table.at(-0.20 + 2.0 * thick / std::cos(std::atan(0.15)), 0.0, thick),
                               table.along(0.15, 1.0), 0.40),
                 straight_tube(thick,
                               table.at(-0.20 + thick / std::cos(std::atan(0.15)) + 0.15 * 0.02, 0.02,
                                        thick + std::sqrt(3.0) * thick),
                               table.along(0.15, 1.0), 0.34),
                 // two apart, and one that lies across both
                 straight_tube(thin, table.at(0.14, -0.08, thin), table.along(1.0, 0.1), 0.36),
                 straight_tube(thin, table.at(0.16, 0.10, thin), table.along(1.0, 0.05), 0.36),
                 straight_tube(0.0175, table.at(0.14, 0.01, 2.0 * thin + 0.0175), table.along(-0.4, 1.0), 0.36)};
  scene.solids = {table.top()};
  return scene;
}

Scene moving_tube_scene() {
  Scene scene;
  SceneTube moving = straight_tube(0.016, {-0.06, -0.03, 0.78}, {1.0, 0.3, 0.1}, 0.40);
  moving.motion = {{0.12, 0.05, 0.06}, {0.1, 0.2, 0.5}, {-0.06, -0.03, 0.78}};
  scene.tubes = {moving};
  scene.solids = {wall_at(1.2)};
  return scene;
}

Scene moving_camera_scene() {
  const Table table;
  Scene scene;
  scene.tubes = {straight_tube(0.020, table.at(-0.08, 0.10, 0.020), table.along(1.0, 0.2), 0.42),
                 tube(0.015, table.at(-0.22, -0.14, 0.015), table.along(1.0, 0.0), table.along(0.0, 1.0),
                      {TubePart::straight(0.20), TubePart::arc(0.09, radians(70.0)), TubePart::straight(0.15)})};
  scene.solids = {table.top()};
  scene.camera_path = {{0.0, {-0.15, -0.06, 0.00}, {-0.02, 0.00, 0.85}},
                       {0.4, {-0.03, -0.02, 0.06}, {0.00, 0.02, 0.85}},
                       {0.7, {0.08, 0.02, 0.03}, {0.01, 0.01, 0.85}},
                       {1.0, {0.16, 0.00, -0.04}, {0.02, 0.00, 0.85}}};
  return scene;
}

/// A hand with its forearm. All parts taper by more than the 5 % a tube may, as a hand does.
std::vector<Solid> hand_at(const Vector3d& wrist, const Motion& motion) {
  std::vector<Solid> hand;
  const auto cone = [&](const Vector3d& from, const Vector3d& to, double from_radius, double to_radius) {
    hand.push_back({FrustumShape{wrist + from, wrist + to, from_radius, to_radius}, motion});
    hand.push_back({SphereShape{wrist + to, to_radius}, motion});
  };
  cone({0.0, 0.32, 0.02}, {0.0, 0.0, 0.0}, 0.055, 0.028);
  hand.push_back({SphereShape{wrist + Vector3d(0.012, -0.045, -0.002), 0.036}, motion});
  hand.push_back({SphereShape{wrist + Vector3d(-0.016, -0.050, -0.002), 0.034}, motion});
  hand.push_back({SphereShape{wrist + Vector3d(0.0, -0.020, 0.0), 0.034}, motion});
  cone({-0.034, -0.072, 0.0}, {-0.046, -0.125, -0.010}, 0.0120, 0.0070);
  cone({-0.012, -0.078, 0.0}, {-0.015, -0.142, -0.012}, 0.0125, 0.0070);
  cone({0.012, -0.076, 0.0}, {0.014, -0.136, -0.012}, 0.0125, 0.0070);
  cone({0.034, -0.070, 0.0}, {0.042, -0.116, -0.010}, 0.0110, 0.0065);
  cone({0.040, -0.030, -0.01}, {0.078, -0.070, -0.022}, 0.0150, 0.0090);
  return hand;
}

Scene hand_scene() {
  Scene scene;
  scene.tubes = {bent_tube()};
  scene.solids = hand_at({-0.40, 0.12, 0.62}, {{0.72, -0.02, 0.0}, {0.0, 0.0, 0.1}, {-0.40, 0.12, 0.62}});
  scene.solids.push_back(wall_at(1.2));
  return scene;
}

Scene clutter_scene() {
  const Table table;
  Eigen::Matrix3d upright;
  upright << table.right, table.away, table.up;
  const auto standing = [&](double degrees) {
    return Eigen::Quaterniond(upright * Eigen::AngleAxisd(radians(degrees), Vector3d::UnitZ()).toRotationMatrix());
  };
  Scene scene;
  scene.solids = {{BoxShape{table.at(-0.22, 0.10, 0.05), {0.16, 0.10, 0.10}, standing(25.0)}, {}},
                  {BoxShape{table.at(0.20, 0.16, 0.03), {0.22, 0.12, 0.06}, standing(-15.0)}, {}},
                  {BoxShape{table.at(0.19, 0.15, 0.075), {0.09, 0.07, 0.03}, standing(40.0)}, {}},
                  {SphereShape{table.at(0.00, 0.08, 0.045), 0.045}, {}},
                  {BowlShape{table.at(0.18, -0.10, 0.08), table.up, 0.08}, {}},
                  {FrustumShape{table.at(-0.10, -0.14, 0.0), table.at(-0.10, -0.14, 0.12), 0.055, 0.012}, {}},
                  {FrustumShape{table.at(-0.28, -0.12, 0.0), table.at(-0.28, -0.12, 0.10), 0.035, 0.055}, {}},
                  table.top()};
  return scene;
}

Scene far_thick_scene() {
  Scene scene;
  scene.tubes = {straight_tube(0.080, {0.05, 0.0, 2.7}, {1.0, 0.3, 0.1}, 1.4)};
  scene.solids = {wall_at(3.6)};
  return scene;
}

Scene near_thin_scene() {
  Scene scene;
  scene.tubes = {straight_tube(0.005, {0.0, 0.0, 0.42}, {1.0, -0.3, 0.05}, 0.30)};
  scene.solids = {wall_at(0.6)};
  return scene;
}

struct Preset {
  std::string_view name;
  Scene (*make)();
};

constexpr std::array<Preset, 10> kPresets{{{"straight", straight_scene},
                                           {"bent", bent_scene},
                                           {"crossing", crossing_scene},
                                           {"pile", pile_scene},
                                           {"moving-tube", moving_tube_scene},
                                           {"moving-camera", moving_camera_scene},
                                           {"hand", hand_scene},
                                           {"clutter", clutter_scene},
                                           {"far-thick", far_thick_scene},
                                           {"near-thin", near_thin_scene}}};

constexpr auto kNames = [] {
  std::array<std::string_view, kPresets.size()> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = kPresets[i].name;
  return names;
}();

}  // namespace

std::span<const std::string_view> preset_names() {
  return kNames;
}

Expected<Scene> preset_scene(std::string_view name) {
  for (const Preset& preset : kPresets) {
    if (preset.name != name) continue;
    Scene scene = preset.make();
    scene.name = name;
    return scene;
  }
  return tl::make_unexpected(
      Error::usage(fmt::format("scene: got '{}', takes a .json file or one of {}", name, fmt::join(kNames, ", "))));
}

}  // namespace tubetrack
