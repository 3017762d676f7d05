#include "drift.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "motion.hpp"
#include "tracker/tube_scene.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

const Vector3d kDriftMiddle(0.01, -0.02, 0.8);
const Vector3d kDriftAxis = Vector3d(1.0, 0.3, 0.15).normalized();
constexpr double kFrame_s = 1.0 / 30.0;

TubeModel tube() {
  return straight_model(kDriftMiddle, kDriftAxis, 0.15, 0.015);
}

/// A frame that tells every control point and the radius to `sigma_m`, and sees the tube moved.
Information frame_that_sees(const TubeModel& model, double sigma_m) {
  const Eigen::VectorXd parameters = parameters_of(model);
  const Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(parameters.size(), parameters.size()) / (sigma_m * sigma_m);
  return {matrix, matrix * parameters};
}

/// The drift of a tube over `frames` frames, carried on at `guess_per_s`.
Drift drift_over(int frames, const TubeVelocity& velocity, const TubeVelocity& guess, double sigma_m) {
  Drift drift;
  start_drift(drift, tube());
  for (int i = 0; i < frames; ++i) {
    if (i > 0) {
      move(drift.anchor, during(guess, kFrame_s));
      age(drift, kFrame_s);
    }
    TubeModel seen = tube();
    move(seen, during(velocity, i * kFrame_s));
    add_frame(drift, frame_that_sees(seen, sigma_m));
  }
  return drift;
}

// About its axis a straight tube shows no turn.
const TubeVelocity kCreep{{0.0004, -0.0003, 0.0008}, kDriftAxis.cross(Vector3d(0.002, 0.001, -0.003))};

TEST(Drift, TheVelocityOfManySharpFramesIsFound) {
  const VelocityChange found = judge_velocity(drift_over(30, kCreep, {}, 1e-5), {});
  EXPECT_LT((found.change.shift_m_s - kCreep.shift_m_s).norm(), 1e-6);
  EXPECT_LT((found.change.turn_rad_s - kCreep.turn_rad_s).norm(), 1e-5);
}

TEST(Drift, OnceCarriedOnAtItsVelocityThereIsNothingToChange) {
  const VelocityChange found = judge_velocity(drift_over(30, kCreep, kCreep, 1e-5), kCreep);
  EXPECT_LT(found.change.shift_m_s.norm(), 1e-6);
  EXPECT_LT(found.change.turn_rad_s.norm(), 1e-5);
}

TEST(Drift, TwoFramesCannotTellAVelocityFromTheirNoise) {
  const VelocityChange found = judge_velocity(drift_over(2, kCreep, {}, 1e-3), {});
  EXPECT_LT(found.change.shift_m_s.norm(), 0.02 * kCreep.shift_m_s.norm());
}

TEST(Drift, FramesCarriedAnewAreThoseThatWereCarriedSoFromTheStart) {
  Drift late = drift_over(20, kCreep, {}, 1e-4);
  recarry(late, kCreep);
  const Drift early = drift_over(20, kCreep, kCreep, 1e-4);
  // The one's anchor stayed where the tube was at first, the other's went along.
  Eigen::Matrix<double, 7, 1> way;
  way << kCreep.shift_m_s, kCreep.turn_rad_s, 0.0;
  way *= 19 * kFrame_s;
  const Eigen::Matrix<double, 7, 1> expected = late.information * way;
  EXPECT_LT((late.seen - expected - early.seen).norm(), 1e-3 * expected.norm());
}

TEST(Drift, ALongerOrShorterSplineChangesNothingThatWasSeen) {
  for (const int front : {-1, 1}) {
    for (const int back : {-1, 0, 1}) {
      Drift drift = drift_over(30, kCreep, {}, 1e-5);
      const Vector3d middle = middle_of(drift.anchor);
      respan(drift, front, back);
      const TubeVelocity found = judge_velocity(drift, {}).change;
      const Vector3d expected = kCreep.shift_m_s + kCreep.turn_rad_s.cross(middle_of(drift.anchor) - middle);
      EXPECT_LT((found.shift_m_s - expected).norm(), 1e-6) << front << back;
      EXPECT_LT((found.turn_rad_s - kCreep.turn_rad_s).norm(), 1e-5) << front << back;
    }
  }
}

// For n frames at equal distances, not knowing the velocity makes the place at the last of them 4 n / (n + 1) … times
// less sure in variance: (4 n − 2) / (n (n + 1)) against 1 / n.
TEST(Drift, NotKnowingTheVelocityAddsWhatARegressionLineSays) {
  constexpr int kFrames = 30;
  constexpr double kSigma_m = 1e-5;
  const Drift drift = drift_over(kFrames, {}, {}, kSigma_m);
  const double points = static_cast<double>(tube().spline.control_m.size());
  const double of_one_frame = kSigma_m * kSigma_m / points;
  const double known = of_one_frame / kFrames;
  const double unknown = of_one_frame * (4.0 * kFrames - 2.0) / (kFrames * (kFrames + 1.0));
  const VelocityChange found = judge_velocity(drift, {});
  EXPECT_NEAR(found.added_covariance(0, 0), unknown - known, 0.02 * (unknown - known));
}

}  // namespace
}  // namespace tubetrack
