#include "pool.hpp"

#include <algorithm>

#include "drift.hpp"
#include "motion.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "varying_fit.hpp"

namespace tubetrack {

namespace {

constexpr int kMaxPooledFrames = 60;  // what is older fades

/// What was pooled, as if everything in it lay elsewhere.
void carry_pool(FollowedTube& tube, const Twist& by) {
  Eigen::Matrix<double, 7, 1> change;
  change << by.shift_m, by.turn_rad, 0.0;
  const RecycledColumn moved = by_motion(tube.model) * change;
  tube.pooled.vector.noalias() += tube.pooled.matrix * moved;
}

/// Adds to a covariance of control points and radius that of a motion of them all; of control points at most three
/// apart, as FitQuality has it.
void add_motion(const TubeModel& model, const Eigen::Matrix<double, 6, 6>& motion, RecycledMatrix& covariance) {
  const RecycledMatrix jacobian = by_motion(model);
  const Eigen::Index last = covariance.rows() - 1;
  for (Eigen::Index row = 0; row < last; row += 3) {
    const Eigen::Matrix<double, 3, 6> by_row = jacobian.block<3, 6>(row, 0) * motion;
    for (Eigen::Index col = std::max<Eigen::Index>(0, row - 9); col < std::min(last, row + 12); col += 3) {
      covariance.block<3, 3>(row, col) += by_row * jacobian.block<3, 6>(col, 0).transpose();
    }
  }
}

}  // namespace

Information no_information(const TubeModel& model) {
  const auto size = static_cast<Eigen::Index>(3 * model.spline.control_m.size() + 1);
  return {Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
}

Information radius_only(const FollowedTube& tube) {
  Information information = no_information(tube.model);
  const Eigen::Index last = information.vector.size() - 1;
  information.matrix(last, last) = tube.radius_information;
  information.vector[last] = tube.radius_information * tube.model.radius_m;
  return information;
}

void start_pool(FollowedTube& tube) {
  tube.at_rest = true;
  tube.velocity = {};
  tube.frames_pooled = 0;
  tube.pooled = radius_only(tube);
  start_drift(tube.drift, tube.model);
}

void add_to_pool(FollowedTube& tube) {
  const double doubt = std::max(1.0, tube.quality.chi2_per_observation);
  if (++tube.frames_pooled > kMaxPooledFrames) {
    constexpr double kFactor = 1.0 - 1.0 / kMaxPooledFrames;
    tube.pooled.matrix *= kFactor;
    tube.pooled.vector *= kFactor;
    fade(tube.drift, kFactor);
  }
  const Information observed{tube.quality.observed.matrix / doubt, tube.quality.observed.vector / doubt};
  tube.pooled.matrix += observed.matrix;
  tube.pooled.vector += observed.vector;
  add_frame(tube.drift, observed);
}

void add_to_profile_pool(FollowedTube& tube) {
  const ProfileInformation& seen = tube.quality.profile;
  if (seen.values.vector.size() == 0) return;
  ProfileInformation& pool = tube.profile_pool;
  if (!tube.at_rest) {
    pool = {};
    return;
  }
  pool.values = placed(pool, seen.first, seen.values.vector.size());
  pool.first = seen.first;
  constexpr double kFactor = 1.0 - 1.0 / kMaxPooledFrames;
  const double doubt = std::max(1.0, tube.quality.chi2_per_observation);
  pool.values.matrix = kFactor * pool.values.matrix + seen.values.matrix / doubt;
  pool.values.vector = kFactor * pool.values.vector + seen.values.vector / doubt;
}

void creep_on(FollowedTube& tube, double elapsed_s) {
  const Twist by = during(tube.velocity, elapsed_s);
  carry_pool(tube, by);
  move(tube.model, by);
  move(tube.drift.anchor, by);
  age(tube.drift, elapsed_s);
}

void judge_creep(FollowedTube& tube) {
  const VelocityChange found = judge_velocity(tube.drift, tube.velocity);
  recarry(tube.drift, found.change);
  tube.velocity.shift_m_s += found.change.shift_m_s;
  tube.velocity.turn_rad_s += found.change.turn_rad_s;
  const Twist by = during(found.change, mean_age_s(tube.drift));
  carry_pool(tube, by);
  move(tube.model, by);
  add_motion(tube.model, found.added_covariance, tube.quality.covariance);
}

void transform(FollowedTube& tube, const Eigen::Isometry3d& new_from_old) {
  const auto move_model = [&](TubeModel& model) {
    for (Eigen::Vector3d& control : model.spline.control_m) control = new_from_old * control;
  };
  move_model(tube.model);
  move_model(tube.anchor);
  move_model(tube.drift.anchor);
  const Eigen::Matrix3d rotation = new_from_old.linear();
  const auto turn_blocks = [&](RecycledMatrix& matrix) {
    const Eigen::Index last = matrix.rows() - 1;
    for (Eigen::Index row = 0; row < last; row += 3) {
      for (Eigen::Index col = 0; col < last; col += 3) {
        auto block = matrix.block<3, 3>(row, col);
        if ((block.array() != 0.0).any()) block = (rotation * Eigen::Matrix3d(block) * rotation.transpose()).eval();
      }
      matrix.block<3, 1>(row, last) = rotation * Eigen::Vector3d(matrix.block<3, 1>(row, last));
      matrix.block<1, 3>(last, row) = Eigen::RowVector3d(matrix.block<1, 3>(last, row)) * rotation.transpose();
    }
  };
  const auto carry = [&](Information& information) {
    turn_blocks(information.matrix);
    RecycledColumn shift = Eigen::VectorXd::Zero(information.vector.size());
    for (Eigen::Index k = 0; k + 3 <= shift.size(); k += 3) {
      information.vector.segment<3>(k) = rotation * Eigen::Vector3d(information.vector.segment<3>(k));
      shift.segment<3>(k) = new_from_old.translation();
    }
    information.vector.noalias() += information.matrix * shift;
  };
  carry(tube.pooled);
  carry(tube.quality.observed);
  turn_blocks(tube.quality.covariance);
  turn(tube.drift, rotation);
  tube.velocity.shift_m_s = rotation * tube.velocity.shift_m_s;
  tube.velocity.turn_rad_s = rotation * tube.velocity.turn_rad_s;
}

}  // namespace tubetrack
