#include "tubetrack/sensors/disparity_levels.hpp"

#include <cmath>
#include <optional>

#include "tubetrack/heightmap/height_map.hpp"

namespace tubetrack {

std::optional<bool> lies_at_disparity_levels(const DepthFrame& frame, const NoiseModel& noise) {
  const DisparityLevels levels = disparity_levels(noise, frame.metres_per_unit);
  if (levels.per_level_m <= 0.0) return false;
  constexpr int kStep = 97;  // a prime, so that the sample doesn't follow columns
  // Where levels lie hardly farther apart than units, a reading tells little: of those that lie at none, one in eleven.
  constexpr double kLeastSpacing = 1.1;
  constexpr double kLeastMisses = 60.0;  // that would be, were the readings at none
  int asked = 0;
  int missed = 0;
  double misses_at_none = 0.0;
  int next = 0;
  for (int v = 0; v < frame.height; ++v) {
    for (; next < frame.width; next += kStep) {
      const double z = frame.row(v)[next] * frame.metres_per_unit;
      const double spacing = z * z / levels.per_level_m / frame.metres_per_unit;
      if (z <= 0.0 || spacing < kLeastSpacing) continue;
      ++asked;
      missed += std::abs(depth_of_level_m(levels, z) - z) <= 0.501 * frame.metres_per_unit ? 0 : 1;
      misses_at_none += 1.0 - 1.0 / spacing;
    }
    next -= frame.width;
  }
  if (misses_at_none < kLeastMisses) return std::nullopt;
  return 50 * missed <= asked && 16 * missed <= misses_at_none;
}

}  // namespace tubetrack
