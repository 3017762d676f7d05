// `varying_radius`: the centreline and the radius along it, on hoses of known shape.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "tubetrack/replay/render.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack {
namespace {

/// Keys every 5 mm.
template <class Radius>
std::vector<RadiusKey> keys(double length_m, const Radius& radius_at_m) {
  std::vector<RadiusKey> profile;
  for (int i = 0; 0.005 * i < length_m + 0.004; ++i) profile.push_back({0.005 * i, radius_at_m(0.005 * i)});
  return profile;
}

Scene before_a_wall(const SceneTube& tube) {
  Scene scene;
  scene.tubes = {tube};
  scene.solids = {{PlaneShape{{0.0, 0.0, 1.2}, -Eigen::Vector3d::UnitZ()}, {}}};
  return scene;
}

/// 14 to 32 mm over 0.3 m: a taper of 6 %.
Scene cone() {
  SceneTube tube;
  tube.start_m = {-0.15, -0.02, 0.78};
  tube.direction = {1.0, 0.15, 0.1};
  tube.parts = {TubePart::straight(0.3)};
  tube.radius_profile = {{0.0, 0.014}, {0.3, 0.032}};
  return before_a_wall(tube);
}

/// 18 mm, and 24 mm where it bulges.
Scene bulge() {
  SceneTube tube;
  tube.start_m = {-0.27, 0.05, 0.8};
  tube.direction = {1.0, -0.1, 0.05};
  tube.parts = {TubePart::straight(0.55)};
  tube.radius_profile =
      keys(0.55, [](double s) { return 0.018 + 0.006 * std::exp(-0.5 * std::pow((s - 0.27) / 0.05, 2)); });
  return before_a_wall(tube);
}

/// A bent hose from 15 to 24 mm.
Scene bent_hose() {
  SceneTube tube;
  tube.start_m = {-0.25, 0.1, 0.84};
  tube.direction = {1.0, 0.0, 0.0};
  tube.bend_direction = {0.0, -1.0, 0.0};
  tube.parts = {TubePart::straight(0.18), TubePart::arc(0.15, 1.1), TubePart::straight(0.12)};
  tube.radius_profile = {{0.05, 0.015}, {0.4, 0.024}};
  return before_a_wall(tube);
}

struct Errors {
  double line_m = 0.0;    ///< RMS of the nodes to the true centreline
  double radius_m = 0.0;  ///< RMS of the nodes' radii
  double worst_radius_m = 0.0;
  double sigmas = 0.0;       ///< RMS of the radii's errors in their σ
  double line_sigmas = 0.0;  ///< of the places' errors across the tube, in `sigma_m`
  double found = 0.0;        ///< reported length over the true one
};

/// Of the nodes more than a radius away from the true ends, and the reported ones.
Errors errors_of(const Tube& tube, const TrueTube& truth) {
  Errors errors;
  double nodes = 0.0;
  const auto count = tube.centerline_m.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d& node = tube.centerline_m[i];
    if ((node - tube.centerline_m.front()).norm() < truth.radius_m) continue;
    if ((node - tube.centerline_m.back()).norm() < truth.radius_m) continue;
    double nearest_m = std::numeric_limits<double>::infinity(), true_radius_m = 0.0;
    for (std::size_t k = 0; k + 1 < truth.centerline_m.size(); ++k) {
      const Eigen::Vector3d way = truth.centerline_m[k + 1] - truth.centerline_m[k];
      const double s = std::clamp((node - truth.centerline_m[k]).dot(way) / way.squaredNorm(), 0.0, 1.0);
      const double off_m = (node - truth.centerline_m[k] - s * way).norm();
      if (off_m >= nearest_m) continue;
      nearest_m = off_m;
      true_radius_m = (1.0 - s) * truth.node_radius_m[k] + s * truth.node_radius_m[k + 1];
    }
    const double off_m = tube.node_radius_m.at(i) - true_radius_m;
    errors.line_m += nearest_m * nearest_m;
    errors.line_sigmas += std::pow(nearest_m / tube.sigma_m[i], 2);
    errors.radius_m += off_m * off_m;
    errors.worst_radius_m = std::max(errors.worst_radius_m, std::abs(off_m));
    errors.sigmas += std::pow(off_m / tube.node_radius_sigma_m.at(i), 2);
    ++nodes;
  }
  for (double* sum : {&errors.line_m, &errors.radius_m, &errors.sigmas, &errors.line_sigmas})
    *sum = std::sqrt(*sum / nodes);
  errors.found = tube.length_m / truth.length_m;
  return errors;
}

/// RMS over all seeds of what the last of so many frames says.
Errors errors_after(Scene scene, int frames, int seeds, const char* name) {
  TrackerConfig config;
  config.varying_radius = true;
  config.noise = *noise_model_by_name("synthetic");
  Errors all;
  for (int seed = 1; seed <= seeds; ++seed) {
    scene.seed = static_cast<std::uint64_t>(seed);
    auto tracker = TubeTracker::create(config, scene.camera);
    TubeFrame result;
    RenderedFrame rendered;
    for (int frame = 0; frame < frames; ++frame) {
      rendered = render_frame(scene, frame, {});
      result = tracker->track(depth_frame(rendered));
    }
    EXPECT_EQ(result.tubes.size(), 1U) << name << ", seed " << seed;
    if (result.tubes.size() != 1) return all;
    const Errors errors = errors_of(result.tubes[0], rendered.truth.tubes[0]);
    all.line_m = std::hypot(all.line_m, errors.line_m / std::sqrt(seeds));
    all.radius_m = std::hypot(all.radius_m, errors.radius_m / std::sqrt(seeds));
    all.sigmas = std::hypot(all.sigmas, errors.sigmas / std::sqrt(seeds));
    all.line_sigmas = std::hypot(all.line_sigmas, errors.line_sigmas / std::sqrt(seeds));
    all.worst_radius_m = std::max(all.worst_radius_m, errors.worst_radius_m);
    all.found += errors.found / seeds;
  }
  fmt::print(
      "{:6} after {:2} frames: centreline RMS {:.3f} mm ({:.2f} σ), radii RMS {:.3f} mm ({:.2f} σ), worst {:.3f} mm, "
      "length {:.1f} %\n",
      name, frames, 1e3 * all.line_m, all.line_sigmas, 1e3 * all.radius_m, all.sigmas, 1e3 * all.worst_radius_m,
      100.0 * all.found);
  return all;
}

/// What a scene must reach; metres.
struct Case {
  const char* name;
  Scene (*scene)();
  double line_1, radius_1, line_30, radius_30;  // after 1 frame and 30
};

class VaryingRadius : public ::testing::TestWithParam<Case> {};

TEST_P(VaryingRadius, ASingleFrameShowsTheCentrelineAndTheRadiusAlongIt) {
  const Errors errors = errors_after(GetParam().scene(), 1, 3, GetParam().name);
  EXPECT_LE(errors.line_m, GetParam().line_1);
  EXPECT_LE(errors.radius_m, GetParam().radius_1);
  EXPECT_LE(errors.sigmas, 1.4);
  EXPECT_LE(errors.line_sigmas, 1.4);
  EXPECT_GE(errors.found, 0.98);
}

TEST_P(VaryingRadius, ThirtyFramesAtRestShowThemToATenthOfAMillimetre) {
  const Errors errors = errors_after(GetParam().scene(), 30, 1, GetParam().name);
  EXPECT_LE(errors.line_m, GetParam().line_30);
  EXPECT_LE(errors.radius_m, GetParam().radius_30);
  EXPECT_LE(errors.sigmas, 2.0);  // one tube: its errors move together
  EXPECT_LE(errors.line_sigmas, 2.0);
}

INSTANTIATE_TEST_SUITE_P(Hoses, VaryingRadius,
                         ::testing::Values(Case{"cone", cone, 0.0003, 0.00025, 0.00008, 0.00006},
                                           Case{"bulge", bulge, 0.00032, 0.0003, 0.00011, 0.0001},
                                           Case{"hose", bent_hose, 0.00036, 0.00032, 0.00014, 0.00008}),
                         [](const auto& row) { return std::string(row.param.name); });

TEST(VaryingRadiusInMotion, AConeThatSlidesAlongItselfIsSeenAsWellAsInASingleFrame) {
  Scene scene = cone();
  scene.tubes[0].motion.velocity_m_s = {0.09, 0.03, 0.03};
  const Errors errors = errors_after(scene, 15, 1, "slides");
  EXPECT_LE(errors.line_m, 0.0002);
  EXPECT_LE(errors.radius_m, 0.00015);
}

TEST(VaryingRadiusOff, AConeIsNoTubeUnlessAskedFor) {
  auto tracker = TubeTracker::create({}, cone().camera);
  EXPECT_TRUE(tracker->track(depth_frame(render_frame(cone(), 0, {}))).tubes.empty());
}

}  // namespace
}  // namespace tubetrack
