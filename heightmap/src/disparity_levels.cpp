#include "tubetrack/sensors/disparity_levels.hpp"

#include <cmath>

#include "tubetrack/heightmap/height_map.hpp"

namespace tubetrack {

bool lies_at_disparity_levels(const DepthFrame& frame, const NoiseModel& noise) {
  const DisparityLevels levels = disparity_levels(noise, frame.metres_per_unit);
  if (levels.per_level_m <= 0.0) return false;
  constexpr int kStep = 97;  // a prime, so that the sample doesn't follow columns
  int asked = 0;
  int at_level = 0;
  int next = 0;
  for (int v = 0; v < frame.height; ++v) {
    for (; next < frame.width; next += kStep) {
      const double z = frame.row(v)[next] * frame.metres_per_unit;
      // Between two levels there must be room for readings that lie at none.
      const double spacing_m = z * z / levels.per_level_m;
      if (z <= 0.0 || spacing_m < 1.5 * frame.metres_per_unit) continue;
      ++asked;
      at_level += std::abs(depth_of_level_m(levels, z) - z) <= 0.501 * frame.metres_per_unit ? 1 : 0;
    }
    next -= frame.width;
  }
  return asked >= 200 && 50 * at_level >= 49 * asked;
}

}  // namespace tubetrack
