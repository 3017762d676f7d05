#pragma once

#include <Eigen/Core>

#include "normal_equations.hpp"
#include "tubetrack/tracker/follow.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// A small motion of a tube as a whole: a turn about the middle of its control points, then a shift.
struct Twist {
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();
};

/// The motion in a time at a velocity.
inline Twist during(const TubeVelocity& velocity, double elapsed_s) {
  return {elapsed_s * velocity.shift_m_s, elapsed_s * velocity.turn_rad_s};
}

void move(TubeModel& model, const Twist& twist);

/// How far a step took what is in sight, along the line or in radius.
double moved_m(const TubeModel& from, const TubeModel& to, const Extent& extent);

/// Mean of the control points: what a tube turns about.
Eigen::Vector3d middle_of(const TubeModel& model);

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);

/// Change of all parameters (in Information's order) by a twist and the radius: 7 columns.
RecycledMatrix by_motion(const TubeModel& model);

/// What Information's matrix or vector says of a motion and the radius: by_motionᵀ · matrix · by_motion, and by_motionᵀ
/// · vector. Of the matrix only control points at most three apart, and the radius, are looked at.
Eigen::Matrix<double, 7, 7> onto_motion(const TubeModel& model, const RecycledMatrix& matrix);
Eigen::Matrix<double, 7, 1> onto_motion(const TubeModel& model, const RecycledColumn& vector);

/// What a tube can't have moved by from one frame to the next, so that unseen motions don't run away.
Eigen::Matrix<double, 7, 7> weak_prior(const TubeModel& model);

/// How a tube seems to have moved, and how surely: information of (shift, turn), the radius taken out.
struct MotionEstimate {
  Twist twist;
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
};

/// The motion that the observations behind `observed` and `observed_right` (as in NormalEquations) ask for, given that
/// the shape stays and the radius is known to `radius_information` (1/m²). Along its axis and about it a straight tube
/// shows no motion: there the estimate stays near zero, whatever the noise in its line.
MotionEstimate estimate_motion(const TubeModel& model, const RecycledMatrix& observed,
                               const RecycledColumn& observed_right, double radius_information);

/// σ of the shift across a tube's axis (a unit vector), where it is known least, given its turn: so that what is seen
/// well at one end alone counts as known.
double sigma_across_m(const MotionEstimate& estimate, const Eigen::Vector3d& axis);

/// χ² (6 degrees of freedom) of an estimated motion against none, where the place moved from is itself only known to
/// `known` (a matrix as Information's).
double motion_chi2(const TubeModel& model, const MotionEstimate& estimate, const RecycledMatrix& known);

}  // namespace tubetrack
