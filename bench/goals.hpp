#pragma once

#include <limits>

#include "suite.hpp"

namespace tubetrack::bench {

constexpr double kNoGoal = std::numeric_limits<double>::quiet_NaN();

/// What a row must reach (DESIGN §5); NaN where nothing is asked of it.
struct Goals {
  double rms_single_m = 0.0003;
  double rms_last_m = kNoGoal;
  double radius_last_m = kNoGoal;
  double least_coverage = 0.97;
  double most_false_length = 0.005;
  double least_idf1 = 0.99;
  double least_inside = 0.93;  ///< of the truth inside the 95 % interval
  double most_inside = 0.97;
  double most_sigma_over_bound = 1.5;
};

inline Goals goals_of(const Row& row) {
  Goals goals;
  if (row.at_rest) {
    goals.rms_last_m = 0.00012;
    goals.radius_last_m = 0.00015;
  } else {
    goals.rms_last_m = goals.rms_single_m;
  }
  if (row.name == "pose-errors") {
    goals.rms_single_m = goals.rms_last_m = 0.0035;
    goals.least_inside = goals.most_inside = kNoGoal;  // no interval can know of a wrong pose in a single frame
    goals.most_sigma_over_bound = kNoGoal;
  }
  // Far and thick tubes are seen with more noise than the goal supposes.
  if (row.single_shots) goals.rms_single_m = kNoGoal;
  return goals;
}

}  // namespace tubetrack::bench
