#include "drift.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

#include "motion.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector7 = Eigen::Matrix<double, 7, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Matrix13 = Eigen::Matrix<double, 13, 13>;

// What calls itself at rest creeps by about this: a hand that holds still, a settling table, a camera that warms up.
constexpr double kCreep_m_s = 0.001;

Vector6 as_vector(const TubeVelocity& velocity) {
  Vector6 v;
  v << velocity.shift_m_s, velocity.turn_rad_s;
  return v;
}

/// The farthest that a point of the tube lies from what it turns about.
double reach_m(const TubeModel& model) {
  const Eigen::Vector3d middle = middle_of(model);
  double reach = model.radius_m;
  for (const Eigen::Vector3d& point : model.spline.control_m) reach = std::max(reach, (point - middle).norm());
  return reach;
}

}  // namespace

void start_drift(Drift& drift, const TubeModel& place) {
  drift = {};
  drift.anchor = place;
}

double mean_age_s(const Drift& drift) {
  const double all = drift.information.topLeftCorner<3, 3>().trace();
  return all > 0.0 ? drift.by_age.topLeftCorner<3, 3>().trace() / all : 0.0;
}

void add_frame(Drift& drift, const Information& observed) {
  RecycledColumn seen = observed.vector;
  seen.noalias() -= observed.matrix * parameters_of(drift.anchor);
  drift.information += onto_motion(drift.anchor, observed.matrix);
  drift.seen += onto_motion(drift.anchor, seen);
}

void age(Drift& drift, double elapsed_s) {
  drift.by_age2 += 2.0 * elapsed_s * drift.by_age + elapsed_s * elapsed_s * drift.information;
  drift.by_age += elapsed_s * drift.information;
  drift.seen_by_age += elapsed_s * drift.seen;
}

void fade(Drift& drift, double factor) {
  drift.information *= factor;
  drift.by_age *= factor;
  drift.by_age2 *= factor;
  drift.seen *= factor;
  drift.seen_by_age *= factor;
}

void respan(Drift& drift, int front, int back) {
  if (drift.anchor.spline.control_m.empty()) return;  // not started
  const Eigen::Vector3d middle = middle_of(drift.anchor);
  auto& control = drift.anchor.spline.control_m;
  if (front < 0) control.erase(control.begin(), control.begin() - front);
  if (back < 0) control.erase(control.end() + back, control.end());
  for (; front > 0; --front) extend(drift.anchor.spline, true, false);
  for (; back > 0; --back) extend(drift.anchor.spline, false, true);
  // The same motion, told as a turn about the new middle: what it turns by shifts the old one less.
  Matrix7 old_from_new = Matrix7::Identity();
  old_from_new.block<3, 3>(0, 3) = cross_matrix(middle_of(drift.anchor) - middle);
  for (Matrix7* sum : {&drift.information, &drift.by_age, &drift.by_age2}) {
    *sum = old_from_new.transpose() * *sum * old_from_new;
  }
  drift.seen = old_from_new.transpose() * drift.seen;
  drift.seen_by_age = old_from_new.transpose() * drift.seen_by_age;
}

void turn(Drift& drift, const Eigen::Matrix3d& new_from_old) {
  Matrix7 rotation = Matrix7::Identity();
  rotation.block<3, 3>(0, 0) = rotation.block<3, 3>(3, 3) = new_from_old;
  for (Matrix7* sum : {&drift.information, &drift.by_age, &drift.by_age2})
    *sum = rotation * *sum * rotation.transpose();
  drift.seen = rotation * drift.seen;
  drift.seen_by_age = rotation * drift.seen_by_age;
}

/// A frame of age a saw the tube at d − v a. Least squares for the place now, d (with the radius), and v, which is held
/// near zero by what a tube at rest may creep.
VelocityChange judge_velocity(const Drift& drift, const TubeVelocity& velocity) {
  const double turn_rad_s = kCreep_m_s / reach_m(drift.anchor);
  Vector6 hold = Vector6::Constant(1.0 / (kCreep_m_s * kCreep_m_s));
  hold.tail<3>().setConstant(1.0 / (turn_rad_s * turn_rad_s));
  const Matrix7 place = drift.information + weak_prior(drift.anchor);
  Matrix13 matrix;
  matrix.topLeftCorner<7, 7>() = place;
  matrix.topRightCorner<7, 6>() = -drift.by_age.leftCols<6>();
  matrix.bottomLeftCorner<6, 7>() = -drift.by_age.topRows<6>();
  matrix.bottomRightCorner<6, 6>() = drift.by_age2.topLeftCorner<6, 6>();
  matrix.bottomRightCorner<6, 6>().diagonal() += hold;
  Eigen::Matrix<double, 13, 1> right;
  right << drift.seen, -drift.seen_by_age.head<6>() - hold.cwiseProduct(as_vector(velocity));
  const Eigen::LDLT<Matrix13> solver(matrix);
  const Vector6 change = solver.solve(right).tail<6>();
  const Matrix13 covariance = solver.solve(Matrix13::Identity());
  const Matrix7 without = place.inverse();
  return {{change.head<3>(), change.tail<3>()}, covariance.topLeftCorner<6, 6>() - without.topLeftCorner<6, 6>()};
}

void recarry(Drift& drift, const TubeVelocity& change) {
  Vector7 all = Vector7::Zero();
  all.head<6>() = as_vector(change);
  drift.seen += drift.by_age * all;
  drift.seen_by_age += drift.by_age2 * all;
}

}  // namespace tubetrack
