#pragma once

#include "tubetrack/tracker/follow.hpp"

namespace tubetrack {

/// Starts anew at a place, with no frame and no velocity.
void start_drift(Drift& drift, const TubeModel& place);

/// Mean age of the frames, each counted by what it says of the place. 0 before the first.
double mean_age_s(const Drift& drift);

/// Takes in what one frame says of the tube (Information of its observations alone, of the anchor's size).
void add_frame(Drift& drift, const Information& observed);

/// Lets time pass: all frames so far get older.
void age(Drift& drift, double elapsed_s);

/// Makes what older frames say count less, by a factor.
void fade(Drift& drift, double factor);

/// Gives the anchor so many control points more (or, below 0, fewer) at either end, straight on. What was seen stays.
/// Nothing happens before `start_drift`.
void respan(Drift& drift, int front, int back);

/// Carries it (but for its anchor) into another frame of reference.
void turn(Drift& drift, const Eigen::Matrix3d& new_from_old);

/// By how much the velocity that the frames so far were carried on with is wrong, and what not knowing it adds to the
/// covariance of the place (shift, turn).
struct VelocityChange {
  TubeVelocity change;
  Eigen::Matrix<double, 6, 6> added_covariance = Eigen::Matrix<double, 6, 6>::Zero();
};
VelocityChange judge_velocity(const Drift& drift, const TubeVelocity& velocity);

/// The same frames as if they had been carried on with a velocity that differs by so much.
void recarry(Drift& drift, const TubeVelocity& change);

}  // namespace tubetrack
