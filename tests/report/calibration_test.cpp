#include "tubetrack/report/calibration.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

namespace tubetrack {
namespace {

using testing::DoubleNear;

constexpr double kTrueRadius_m = 0.015;
constexpr double kSigma_m = 0.0002;

/// Along x, 0.8 m in front of the camera.
TrueTube true_tube() {
  TrueTube tube;
  tube.id = 1;
  tube.radius_m = kTrueRadius_m;
  for (int i = 0; i <= 200; ++i) tube.centerline_m.emplace_back(0.002 * i - 0.2, 0.0, 0.8);
  tube.visible.assign(tube.centerline_m.size(), true);
  return tube;
}

TruthFrame truth() {
  return {0, 0.0, "camera", {true_tube()}};
}

/// 19 nodes on the true tube, shifted, equally sure in all directions.
Tube reported(const Eigen::Vector3d& shift_m) {
  Tube tube;
  tube.id = 7;
  tube.radius_m = kTrueRadius_m;
  tube.radius_sigma_m = kSigma_m;
  tube.confidence = 0.9;
  for (int i = 1; i < 20; ++i) {
    tube.centerline_m.emplace_back(Eigen::Vector3d(0.02 * i - 0.2, 0.0, 0.8) + shift_m);
    tube.sigma_m.push_back(kSigma_m);
    tube.node_covariance_m2.emplace_back(kSigma_m * kSigma_m * Eigen::Matrix3d::Identity());
    tube.node_visible.push_back(true);
  }
  return tube;
}

Calibration calibrated(const Tube& tube) {
  TubeFrame result;
  result.tubes = {tube};
  Calibration calibration;
  add_frame(calibration, truth(), result, Eigen::Isometry3d::Identity(), {});
  return calibration;
}

TEST(Calibration, AnExactLineIsInside) {
  const Calibration calibration = calibrated(reported(Eigen::Vector3d::Zero()));
  ASSERT_EQ(calibration.nodes.size(), 19U);
  EXPECT_EQ(calibration.nodes_inside(), 1.0);
  EXPECT_EQ(calibration.radii_inside(), 1.0);
  EXPECT_THAT(calibration.toward_camera_m(), DoubleNear(0.0, 1e-12));
  EXPECT_EQ(calibration.tubes.at(0).true_id, 1);
}

TEST(Calibration, TheIntervalEndsAt2_4477Sigma) {
  EXPECT_EQ(calibrated(reported({0.0, 2.44 * kSigma_m, 0.0})).nodes_inside(), 1.0);
  EXPECT_EQ(calibrated(reported({0.0, 2.46 * kSigma_m, 0.0})).nodes_inside(), 0.0);
}

TEST(Calibration, OnlyErrorsAcrossTheTubeCount) {
  EXPECT_EQ(calibrated(reported({0.0007, 0.0, 0.0})).nodes_inside(), 1.0);
}

TEST(Calibration, TheCovarianceIsReadInItsDirections) {
  Tube tube = reported({0.0, 0.0, 0.0015});
  const double wide_m = 0.001;
  for (auto& covariance : tube.node_covariance_m2) covariance(2, 2) = wide_m * wide_m;
  EXPECT_EQ(calibrated(tube).nodes_inside(), 1.0);
  for (Eigen::Vector3d& point : tube.centerline_m) point = {point.x(), 0.0015, 0.8};
  EXPECT_EQ(calibrated(tube).nodes_inside(), 0.0);
}

TEST(Calibration, TooNearIsPositive) {
  Tube tube = reported({0.0, 0.0, -0.001});
  tube.radius_m = kTrueRadius_m - 0.0003;
  const Calibration calibration = calibrated(tube);
  // The rays to the ends are slanted by up to 13°.
  EXPECT_THAT(calibration.toward_camera_m(), DoubleNear(0.001, 0.00002));
  EXPECT_THAT(calibration.radius_error_m(), DoubleNear(-0.0003, 1e-12));
  EXPECT_EQ(calibration.radii_inside(), 1.0);
}

TEST(Calibration, TheCameraMayBeElsewhere) {
  TubeFrame result;
  result.tubes = {reported({0.0, 0.0, -0.001})};
  Eigen::Isometry3d camera_from_truth = Eigen::Isometry3d::Identity();
  camera_from_truth.translation() = Eigen::Vector3d(0.0, 0.0, -1.6);  // the camera is behind the tube
  Calibration calibration;
  add_frame(calibration, truth(), result, camera_from_truth, {});
  EXPECT_LT(calibration.toward_camera_m(), -0.0009);
}

TEST(Calibration, HiddenNodesAndNodesPastTheEndDoNotCount) {
  Tube tube = reported(Eigen::Vector3d::Zero());
  tube.node_visible[3] = false;
  tube.centerline_m.back().x() = 0.21;
  EXPECT_EQ(calibrated(tube).nodes.size(), 17U);
}

TEST(Calibration, WhatIsNoTubeHasNoTruth) {
  const Calibration calibration = calibrated(reported({0.0, 0.1, 0.0}));
  EXPECT_TRUE(calibration.nodes.empty());
  EXPECT_TRUE(std::isnan(calibration.nodes_inside()));
  EXPECT_TRUE(std::isnan(calibration.radii_inside()));
  ASSERT_EQ(calibration.tubes.size(), 1U);
  EXPECT_EQ(calibration.tubes[0].true_id, 0);
  EXPECT_EQ(calibration.tubes[0].confidence, 0.9);
}

TEST(Calibration, WhoClaimsToBeExactIsOutside) {
  Tube tube = reported({0.0, 1e-9, 0.0});
  for (auto& covariance : tube.node_covariance_m2) covariance.setZero();
  EXPECT_EQ(calibrated(tube).nodes_inside(), 0.0);
}

TEST(Calibration, ErrorsDrawnFromTheCovarianceAreInside95Percent) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d factor;
  factor << 0.0003, 0.0, 0.0, 0.0001, 0.0002, 0.0, -0.0001, 0.0001, 0.0004;
  Calibration calibration;
  for (int i = 0; i < 500; ++i) {
    TubeFrame result;
    result.tubes = {reported(Eigen::Vector3d::Zero())};
    for (std::size_t node = 0; node < result.tubes[0].centerline_m.size(); ++node) {
      result.tubes[0].centerline_m[node] += factor * Eigen::Vector3d(normal(random), normal(random), normal(random));
      result.tubes[0].node_covariance_m2[node] = factor * factor.transpose();
    }
    add_frame(calibration, truth(), result, Eigen::Isometry3d::Identity(), {});
  }
  EXPECT_THAT(calibration.nodes_inside(), DoubleNear(0.95, 0.01));
}

/// White noise through a box filter eight radii long.
TEST(Calibration, SmoothingIsTheLengthOfTheFilterThatMadeTheErrors) {
  constexpr int kTaps = 16;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Calibration calibration;
  for (int tube = 0; tube < 400; ++tube) {
    std::vector<double> noise(60 + kTaps);
    for (double& value : noise) value = normal(random);
    for (int i = 0; i < 60; ++i) {
      NodeError node;
      node.first = i == 0;
      node.true_radius_m = kTrueRadius_m;
      node.from_start_m = 0.5 * kTrueRadius_m * i;
      for (int tap = 0; tap < kTaps; ++tap) node.sideways_m += noise[static_cast<std::size_t>(i + tap)] / kTaps;
      calibration.nodes.push_back(node);
    }
  }
  EXPECT_THAT(smoothing_radii(calibration), DoubleNear(8.0, 0.5));
  EXPECT_TRUE(std::isnan(smoothing_radii({})));
}

}  // namespace
}  // namespace tubetrack
