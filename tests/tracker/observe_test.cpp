#include "observe.hpp"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <vector>

#include "tracker/tube_scene.hpp"
#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

constexpr double kThickRadius_m = 0.03;

/// The noisy, millimetre-wise view of a straight tube, and a model a little off it.
struct View {
  HeightMap map;
  TubeModel model;
  NoiseModel noise;
};

View look_at_a_tube(bool at_disparity_levels) {
  const Vector3d middle(0.01, -0.02, 0.8);
  const Vector3d axis = Vector3d(1.0, 0.3, 0.15).normalized();
  View view{cylinder_map(kVga, middle, axis, 0.1, kThickRadius_m),
            straight_model(middle, axis, 0.1, 1.02 * kThickRadius_m),
            {}};
  std::mt19937_64 random(3);
  std::normal_distribution<float> gauss(0.0F, 0.003F);
  for (float& depth_m : view.map.depth_m) {
    if (depth_m <= 0.0F) continue;
    depth_m = 0.001F * std::round(1000.0F * (depth_m + gauss(random)));
    if (random() % 50 == 0) depth_m = random() % 2 == 0 ? 0.0F : -depth_m;  // none, or taken out
  }
  view.map.unit_m = 0.001;
  view.map.at_disparity_levels = at_disparity_levels;
  return view;
}

/// What `observe` has of one side: place and direction of each, by stretch.
struct Reading {
  Vector3d point_m;
  Vector3d direction;
  double weight;
  double t;
};
std::vector<Reading> readings_of(const SortedObservations& sorted) {
  std::vector<Reading> readings;
  for (std::size_t k = 0; k + 1 < sorted.first.size(); ++k) {
    const std::size_t span = k / kStretchesPerSpan;
    for (std::size_t i = sorted.first[k]; i < sorted.first[k + 1]; ++i) {
      const ObservedPoint& point = sorted.points[i];
      const ObservedRay& ray = sorted.rays[i];
      if (point.weight == 0.0F) continue;
      readings.push_back({sorted.origin_m[span] + Vector3d(point.x, point.y, point.z),
                          {ray.x, ray.y, ray.z},
                          point.weight,
                          static_cast<double>(span) + ray.s});
    }
  }
  return readings;
}

TEST(Observe, ChoosesTheReadingsThatSelectObservationsDoesStretchByStretch) {
  for (const bool at_levels : {false, true}) {
    for (const int stride : {1, 3}) {
      const View view = look_at_a_tube(at_levels);
      const auto pixels = predict_pixels(view.map, view.noise, view.model, stride);
      const Extent extent{0.7, view.model.spline.spans() - 0.4};
      Sighting sighting;
      observe(view.map, view.noise, view.model.spline, pixels, {0.001, 0.004, 2.0}, extent, sighting);
      auto wanted = select_observations(view.map, view.noise, pixels, 0.001, 2.0, extent);
      const auto all = select_observations(view.map, view.noise, pixels, 0.004, 2.0, extent);
      const std::size_t stretches = (view.model.spline.control_m.size() - 3) * kStretchesPerSpan;
      std::stable_sort(wanted.begin(), wanted.end(), [&](const Observation& a, const Observation& b) {
        return stretch_of(a.t, stretches) < stretch_of(b.t, stretches);
      });
      const auto near = readings_of(sighting.near);
      ASSERT_GT(wanted.size(), 300U);
      ASSERT_GT(all.size(), wanted.size() + 20U);
      ASSERT_EQ(near.size(), wanted.size());
      EXPECT_EQ(sighting.near.count, wanted.size());
      EXPECT_EQ(sighting.far.count, all.size() - wanted.size());
      EXPECT_EQ(readings_of(sighting.far).size(), sighting.far.count);
      for (std::size_t i = 0; i < wanted.size(); ++i) {
        EXPECT_LT((near[i].point_m - wanted[i].point_m).norm(), 2e-7);
        EXPECT_LT((near[i].direction.normalized() - wanted[i].direction).norm(), 2e-7);
        EXPECT_NEAR(near[i].t, wanted[i].t, 1e-6);
        // σ is in lengths of the direction.
        const double sigma_m = near[i].direction.norm() / std::sqrt(near[i].weight);
        EXPECT_NEAR(sigma_m, wanted[i].sigma_m, 1e-6 * sigma_m);
      }
    }
  }
}

TEST(Observe, HasTheSameBytesOnEveryTarget) {
  const View view = look_at_a_tube(true);
  const auto bytes = [&] {
    const auto pixels = predict_pixels(view.map, view.noise, view.model);
    Sighting sighting;
    observe(view.map, view.noise, view.model.spline, pixels, {0.001, 0.004, 2.0}, kWholeTube, sighting);
    std::vector<float> all;
    for (const SortedObservations* side : {&sighting.near, &sighting.far}) {
      for (std::size_t i = 0; i < side->first.back(); ++i) {
        const ObservedPoint& point = side->points[i];
        const ObservedRay& ray = side->rays[i];
        all.insert(all.end(), {point.x, point.y, point.z, point.weight, ray.x, ray.y, ray.z, ray.s});
      }
    }
    return all;
  };
  const std::vector<float> want = bytes();
  ASSERT_GT(want.size(), 1000U);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    const std::vector<float> got = bytes();
    ASSERT_EQ(got.size(), want.size());
    EXPECT_EQ(std::memcmp(got.data(), want.data(), want.size() * sizeof(float)), 0) << hwy::TargetName(target);
  }
  hwy::SetSupportedTargetsForTest(0);
}

}  // namespace
}  // namespace tubetrack
