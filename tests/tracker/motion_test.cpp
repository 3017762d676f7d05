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

const Vector3d kMovedMiddle(0.01, -0.02, 0.8);
const Vector3d kMovedAxis = Vector3d(1.0, 0.3, 0.15).normalized();
constexpr double kMovedRadius_m = 0.015;

/// What the view of a straight tube says to a model that lies `off_m` beside it.
struct MovedView {
  TubeModel model;
  ObservedEquations equations;
};

MovedView view_of_model(const TubeModel& model) {
  const HeightMap map = cylinder_map(kVga, kMovedMiddle, kMovedAxis, 0.1, kMovedRadius_m);
  NoiseModel noise;
  noise.lateral_px = 0.0;
  MovedView view{model, {}};
  const auto observations = select_observations(map, noise, predict_pixels(map, noise, view.model), 0.02, 4.0);
  const auto sorted = sort_by_stretch(observations, view.model.spline);
  view.equations = observed_equations(view.model, sorted, true);
  return view;
}

MovedView view_from(const Vector3d& off_m) {
  return view_of_model(straight_model(kMovedMiddle + off_m, kMovedAxis, 0.1, kMovedRadius_m));
}

MotionEstimate estimate(const MovedView& view, double radius_information) {
  return estimate_motion(view.model, view.equations.matrix, view.equations.right, radius_information);
}

TEST(Motion, AShiftAcrossTheTubeIsFoundToATenthOfIt) {
  for (const double shift_m : {0.0002, 0.001, 0.003}) {
    const Vector3d side = kMovedAxis.cross(kMovedMiddle).normalized();
    const Vector3d away = side.cross(kMovedAxis);
    for (const Vector3d& direction : {side, away}) {
      const MovedView view = view_from(-shift_m * direction);
      const MotionEstimate found = estimate(view, 1e12);
      EXPECT_NEAR(found.twist.shift_m.dot(direction), shift_m, 0.1 * shift_m);
      EXPECT_LT(found.twist.turn_rad.norm(), 0.1 * shift_m / 0.1);
    }
  }
}

TEST(Motion, WhatIsObservedIsProjectedOntoMotionsAsByTheWholeJacobian) {
  const MovedView view = view_from(Vector3d(0.001, 0.0005, -0.001));
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
    TubeModel model = straight_model(kMovedMiddle, kMovedAxis, 0.1, kMovedRadius_m);
    for (Vector3d& point_m : model.spline.control_m)
      point_m += Vector3d(noise_m(random), noise_m(random), noise_m(random));
    const MotionEstimate found = estimate(view_of_model(model), 1e12);
    EXPECT_LT(std::abs(found.twist.shift_m.dot(kMovedAxis)), 0.0002);
    EXPECT_LT(std::abs(found.twist.turn_rad.dot(kMovedAxis)), 0.02);
  }
}

TEST(Motion, RestIsToldFromAFifthOfAMillimetre) {
  const MovedView still = view_from(Vector3d::Zero());
  EXPECT_LT(motion_chi2(still.model, estimate(still, 1e12), still.equations.matrix), 0.01);
  const Vector3d side = kMovedAxis.cross(kMovedMiddle).normalized();
  const MovedView moved = view_from(0.0002 * side);
  EXPECT_GT(motion_chi2(moved.model, estimate(moved, 1e12), 30.0 * still.equations.matrix), 1.0);
  const MovedView far = view_from(0.001 * side);
  EXPECT_GT(motion_chi2(far.model, estimate(far, 1e12), 30.0 * still.equations.matrix), 30.0);
}

TEST(Motion, ATwistMovesAModelAboutItsMiddle) {
  TubeModel model = straight_model(kMovedMiddle, kMovedAxis, 0.1, kMovedRadius_m);
  move(model, {{0.01, 0.0, 0.0}, {0.0, 0.0, 0.1}});
  const double middle = 0.5 * model.spline.spans();
  EXPECT_LT((point_at(model.spline, middle) - kMovedMiddle - Vector3d(0.01, 0.0, 0.0)).norm(), 1e-9);
  const Vector3d along = derivative_at(model.spline, middle).normalized();
  const Vector3d turned = Eigen::AngleAxisd(0.1, Vector3d::UnitZ()) * kMovedAxis;
  EXPECT_LT((along - turned).norm(), 1e-9);
}

}  // namespace
}  // namespace tubetrack
