#include "motion.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

}  // namespace

double moved_m(const TubeModel& from, const TubeModel& to, const Extent& extent) {
  constexpr double kSteps = 16;
  double farthest = 0.0;
  for (double i = 0; i <= kSteps; ++i) {
    const double t = extent.t_begin + (extent.t_end - extent.t_begin) * i / kSteps;
    farthest = std::max({farthest, std::abs(radius_at(to, t) - radius_at(from, t)),
                         (point_at(to.spline, t) - point_at(from.spline, t)).norm()});
  }
  return farthest;
}

Eigen::Vector3d middle_of(const TubeModel& model) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& control : model.spline.control_m) sum += control;
  return sum / static_cast<double>(model.spline.control_m.size());
}

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

RecycledMatrix by_motion(const TubeModel& model) {
  const auto& q = model.spline.control_m;
  const Eigen::Vector3d middle = middle_of(model);
  RecycledMatrix jacobian = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * q.size() + 1), 7);
  for (std::size_t k = 0; k < q.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(3 * k);
    jacobian.block<3, 3>(row, 0).setIdentity();
    jacobian.block<3, 3>(row, 3) = -cross_matrix(q[k] - middle);
  }
  jacobian(jacobian.rows() - 1, 6) = 1.0;
  return jacobian;
}

Matrix7 onto_motion(const TubeModel& model, const RecycledMatrix& matrix) {
  const auto& q = model.spline.control_m;
  const auto count = static_cast<Eigen::Index>(q.size());
  const Eigen::Vector3d middle = middle_of(model);
  const Eigen::Index last = 3 * count;
  Matrix7 motion = Matrix7::Zero();
  for (Eigen::Index j = 0; j < count; ++j) {
    // Turned about the middle, control point j shifts by −arm · turn.
    const Eigen::Matrix3d arm = cross_matrix(q[static_cast<std::size_t>(j)] - middle);
    Eigen::Matrix3d shift = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
    for (Eigen::Index i = std::max<Eigen::Index>(0, j - 3); i <= std::min(count - 1, j + 3); ++i) {
      const Eigen::Matrix3d block = matrix.block<3, 3>(3 * i, 3 * j);
      shift += block;
      turn += cross_matrix(q[static_cast<std::size_t>(i)] - middle) * block;
    }
    motion.block<3, 3>(0, 0) += shift;
    motion.block<3, 3>(3, 0) += turn;
    motion.block<3, 3>(0, 3) -= shift * arm;
    motion.block<3, 3>(3, 3) -= turn * arm;
    const Eigen::Vector3d by_radius = matrix.block<3, 1>(3 * j, last);
    motion.block<3, 1>(0, 6) += by_radius;
    motion.block<3, 1>(3, 6) += arm * by_radius;
  }
  motion.block<1, 6>(6, 0) = motion.block<6, 1>(0, 6).transpose();
  motion(6, 6) = matrix(last, last);
  return motion;
}

Eigen::Matrix<double, 7, 1> onto_motion(const TubeModel& model, const RecycledColumn& vector) {
  const auto& q = model.spline.control_m;
  const Eigen::Vector3d middle = middle_of(model);
  Eigen::Matrix<double, 7, 1> motion = Eigen::Matrix<double, 7, 1>::Zero();
  for (std::size_t k = 0; k < q.size(); ++k) {
    const Eigen::Vector3d part = vector.segment<3>(static_cast<Eigen::Index>(3 * k));
    motion.head<3>() += part;
    motion.segment<3>(3) += (q[k] - middle).cross(part);
  }
  motion[6] = vector[vector.size() - 1];
  return motion;
}

Matrix7 weak_prior(const TubeModel& model) {
  Matrix7 prior = Matrix7::Zero();
  const double shift = 1.0 / (4.0 * model.radius_m * model.radius_m);
  prior.diagonal() << shift, shift, shift, 25.0, 25.0, 25.0, shift;
  return prior;
}

/// A motion along a line, or about it, shows only where the line bends. Of a straight one it is the noise in its shape
/// that seems to tell, which would make it slide to and fro, faster from frame to frame. So what is observed counts
/// against such a motion by as much as a line that leans by kSlope (about it: that lies kSlope radii aside) would tell,
/// several times that noise.
Matrix7 sliding_prior(const TubeModel& model, const RecycledMatrix& observed) {
  constexpr double kSlope = 0.03;
  const auto& q = model.spline.control_m;
  const Eigen::Vector3d middle = middle_of(model);
  Matrix7 prior = Matrix7::Zero();
  for (std::size_t k = 0; k < q.size(); ++k) {
    double information = 0.0;  // of this point moved with its neighbours, summed over three directions
    for (std::size_t j = k < 3 ? 0 : k - 3; j < std::min(q.size(), k + 4); ++j)
      information += observed.block<3, 3>(static_cast<Eigen::Index>(3 * k), static_cast<Eigen::Index>(3 * j)).trace();
    const Eigen::Vector3d along = (q[std::min(k + 1, q.size() - 1)] - q[k > 0 ? k - 1 : 0]).normalized();
    Eigen::Matrix<double, 6, 1> slide;
    slide << along, (q[k] - middle).cross(along);
    const double weight = kSlope * kSlope * information;
    prior.topLeftCorner<6, 6>() += weight * slide * slide.transpose();
    prior.block<3, 3>(3, 3) += weight * model.radius_m * model.radius_m * along * along.transpose();
  }
  return prior;
}

void move(TubeModel& model, const Twist& twist) {
  const Eigen::Vector3d middle = middle_of(model);
  const double angle = twist.turn_rad.norm();
  const Eigen::Matrix3d turn = angle > 1e-12 ? Eigen::AngleAxisd(angle, twist.turn_rad / angle).toRotationMatrix()
                                             : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  for (Eigen::Vector3d& control : model.spline.control_m) {
    control = middle + twist.shift_m + turn * (control - middle);
  }
}

MotionEstimate estimate_motion(const TubeModel& model, const RecycledMatrix& observed,
                               const RecycledColumn& observed_right, double radius_information) {
  Matrix7 information = onto_motion(model, observed) + weak_prior(model) + sliding_prior(model, observed);
  information(6, 6) += radius_information;
  const Eigen::Matrix<double, 7, 1> change = information.ldlt().solve(onto_motion(model, observed_right));
  MotionEstimate estimate;
  estimate.twist = {change.segment<3>(0), change.segment<3>(3)};
  estimate.information = information.topLeftCorner<6, 6>() -
                         information.block<6, 1>(0, 6) * information.block<1, 6>(6, 0) / information(6, 6);
  return estimate;
}

double sigma_across_m(const MotionEstimate& estimate, const Eigen::Vector3d& axis) {
  const Eigen::Vector3d u = axis.unitOrthogonal();
  const Eigen::Vector3d v = axis.cross(u);
  const Eigen::Matrix3d shift = estimate.information.topLeftCorner<3, 3>();
  const double a = u.dot(shift * u), b = u.dot(shift * v), c = v.dot(shift * v);
  const double least = 0.5 * (a + c) - std::hypot(0.5 * (a - c), b);  // the smaller eigenvalue
  return 1.0 / std::sqrt(std::max(least, 1e-12));
}

double motion_chi2(const TubeModel& model, const MotionEstimate& estimate, const RecycledMatrix& known) {
  const Matrix7 before = onto_motion(model, known) + weak_prior(model);
  const Matrix6 covariance = estimate.information.inverse() + before.inverse().topLeftCorner<6, 6>();
  Eigen::Matrix<double, 6, 1> twist;
  twist << estimate.twist.shift_m, estimate.twist.turn_rad;
  return twist.dot(covariance.ldlt().solve(twist));
}

}  // namespace tubetrack
