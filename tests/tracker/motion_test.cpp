#include "motion.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "tracker/tube_scene.hpp"
#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

const Intrinsics kCamera{640, 480, 570.0, 570.0, 319.5, 239.5, {}};
const Vector3d kMiddle(0.01, -0.02, 0.8);
const Vector3d kAxis = Vector3d(1.0, 0.3, 0.15).normalized();
constexpr double kRadius_m = 0.015;

/// What the view of a straight tube says to a model that lies `off_m` beside it.
struct View {
  TubeModel model;
  ObservedEquations equations;
};

View view_of_model(const TubeModel& model) {
  const HeightMap map = cylinder_map(kCamera, kMiddle, kAxis, 0.1, kRadius_m);
  NoiseModel noise;
  noise.lateral_px = 0.0;
  View view{model, {}};
  const auto observations = select_observations(map, noise, predict_pixels(map, noise, view.model), 0.02, 4.0);
  const auto sorted = sort_by_stretch(observations, view.model.spline);
  view.equations = observed_equations(view.model, sorted, true);
  return view;
}

View view_from(const Vector3d& off_m) {
  return view_of_model(straight_model(kMiddle + off_m, kAxis, 0.1, kRadius_m));
}

MotionEstimate estimate(const View& view, double radius_information) {
  return estimate_motion(view.model, view.equations.matrix, view.equations.right, radius_information);
}

TEST(Motion, AShiftAcrossTheTubeIsFoundToATenthOfIt) {
  for (const double shift_m : {0.0002, 0.001, 0.003}) {
    const Vector3d side = kAxis.cross(kMiddle).normalized();
    const Vector3d away = side.cross(kAxis);
    for (const Vector3d& direction : {side, away}) {
      const View view = view_from(-shift_m * direction);
      const MotionEstimate found = estimate(view, 1e12);
      EXPECT_NEAR(found.twist.shift_m.dot(direction), shift_m, 0.1 * shift_m);
      EXPECT_LT(found.twist.turn_rad.norm(), 0.1 * shift_m / 0.1);
    }
  }
}

TEST(Motion, WhatIsObservedIsProjectedOntoMotionsAsByTheWholeJacobian) {
  const View view = view_from(Vector3d(0.001, 0.0005, -0.001));
  const Eigen::MatrixXd jacobian = by_motion(view.model);
  const Eigen::MatrixXd matrix = jacobian.transpose() * view.equations.matrix * jacobian;
  const Eigen::VectorXd vector = jacobian.transpose() * view.equations.right;
  EXPECT_LT((onto_motion(view.model, view.equations.matrix) - matrix).norm(), 1e-12 * matrix.norm());
  EXPECT_LT((onto_motion(view.model, view.equations.right) - vector).norm(), 1e-12 * vector.norm());
}

TEST(Motion, AlongAStraightTubeNothingMoves) {
  const MotionEstimate found = estimate(view_from(Vector3d::Zero()), 1e12);
  EXPECT_LT(found.twist.shift_m.norm(), 1e-6);
}

TEST(Motion, NoiseInTheLineOfAStraightTubeMakesItNeitherSlideNorSpin) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise_m(0.0, 0.0001);
  for (int i = 0; i < 20; ++i) {
    TubeModel model = straight_model(kMiddle, kAxis, 0.1, kRadius_m);
    for (Vector3d& point_m : model.spline.control_m)
      point_m += Vector3d(noise_m(random), noise_m(random), noise_m(random));
    const MotionEstimate found = estimate(view_of_model(model), 1e12);
    EXPECT_LT(std::abs(found.twist.shift_m.dot(kAxis)), 0.0002);
    EXPECT_LT(std::abs(found.twist.turn_rad.dot(kAxis)), 0.02);
  }
}

TEST(Motion, RestIsToldFromAFifthOfAMillimetre) {
  const View still = view_from(Vector3d::Zero());
  EXPECT_LT(motion_chi2(still.model, estimate(still, 1e12), still.equations.matrix), 0.01);
  const Vector3d side = kAxis.cross(kMiddle).normalized();
  const View moved = view_from(0.0002 * side);
  EXPECT_GT(motion_chi2(moved.model, estimate(moved, 1e12), 30.0 * still.equations.matrix), 1.0);
  const View far = view_from(0.001 * side);
  EXPECT_GT(motion_chi2(far.model, estimate(far, 1e12), 30.0 * still.equations.matrix), 30.0);
}

TEST(Motion, ATwistMovesAModelAboutItsMiddle) {
  TubeModel model = straight_model(kMiddle, kAxis, 0.1, kRadius_m);
  move(model, {{0.01, 0.0, 0.0}, {0.0, 0.0, 0.1}});
  const double middle = 0.5 * model.spline.spans();
  EXPECT_LT((point_at(model.spline, middle) - kMiddle - Vector3d(0.01, 0.0, 0.0)).norm(), 1e-9);
  const Vector3d along = derivative_at(model.spline, middle).normalized();
  const Vector3d turned = Eigen::AngleAxisd(0.1, Vector3d::UnitZ()) * kAxis;
  EXPECT_LT((along - turned).norm(), 1e-9);
}

}  // namespace
}  // namespace tubetrack
