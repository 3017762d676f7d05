#pragma once

#include <algorithm>
#include <cmath>

#include "tubetrack/sensors/noise_model.hpp"

namespace tubetrack {

/// The depths that a sensor which measures disparity knows: level n is at per_level_m / n. Written in whole millimetres
/// they are off by up to half of one, the same way over wide areas and in every frame, so that no average takes it out.
struct DisparityLevels {
  double per_level_m = 0.0;  ///< 0: there are none
  double unit_m = 0.0;       ///< readings are whole multiples of it
};

inline DisparityLevels disparity_levels(const NoiseModel& model, double unit_m) {
  return {model.disparity_step_px > 0.0 ? model.baseline_focal_m_px / model.disparity_step_px : 0.0, unit_m};
}

/// The depth (metres) of the level that a reading comes from; the mean of those it may come from where levels are
/// closer than units; the nearest where none is written so. The reading itself where there are no levels.
inline double depth_of_level_m(const DisparityLevels& levels, double reading_m) {
  const double per_level_m = levels.per_level_m;
  // What lies half way is written upward, like 562.5 mm; readings are floats.
  const double lowest_m = reading_m - 0.501 * levels.unit_m;
  if (per_level_m <= 0.0 || lowest_m <= 0.0) return reading_m;
  const double nearest_m = per_level_m / std::max(1.0, std::trunc(per_level_m / reading_m + 0.5));
  if (nearest_m * nearest_m > 1.1 * per_level_m * levels.unit_m) return nearest_m;  // no unit has two
  const double first = std::ceil(per_level_m / (reading_m + 0.499 * levels.unit_m));
  const double last = std::floor(per_level_m / lowest_m);
  if (last < first) return nearest_m;
  // Each is as likely. The mean of so few is that of the outer two.
  return 0.5 * (per_level_m / first + per_level_m / last);
}

}  // namespace tubetrack
