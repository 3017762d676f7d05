#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stretch_sums.hpp"
#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {

/// How far inside the silhouette a pixel must be, so that what jitters across it neither comes in nor is missing.
float least_margin_px(const NoiseModel& noise);

/// What a reading is put right by: `depth_of_level_m` where the map's readings lie at levels, and the jitter's bias.
struct ReadingRule {
  double per_level_m = 0.0;  ///< level n is at per_level_m / n; 0: no levels
};
inline ReadingRule reading_rule(const HeightMap& map, const NoiseModel& noise) {
  if (!map.at_disparity_levels || noise.disparity_step_px <= 0.0) return {};
  return {noise.baseline_focal_m_px / noise.disparity_step_px};
}
inline double unbiased_m(const ReadingRule& rule, const PredictedPixel& pixel, float measured_m) {
  double reading_m = measured_m;
  if (rule.per_level_m > 0.0) {
    const double level = std::trunc(rule.per_level_m / reading_m + 0.5);
    reading_m = rule.per_level_m / std::max(1.0, level);
  }
  return reading_m - pixel.jitter_bias_m;
}

/// What of a tube's predicted pixels may be fitted (as `select_observations` says), ready to be summed: readings within
/// near_m + sigmas·σ of the prediction, and those beyond that within far_m + sigmas·σ.
struct Gates {
  double near_m = 0.0;
  double far_m = 0.0;
  double sigmas = 4.0;
};
struct Sighting {
  SortedObservations near, far;
  /// Scratch of `observe`.
  struct Chosen {
    float depth_m = 0.0F;
    std::uint32_t pixel = 0, stretch = 0;
    bool is_near = true;
  };
  std::vector<Chosen> chosen;  // the first so many
  std::vector<std::size_t> near_next, far_next;
};

/// The pixels must be predicted on this centreline. Buffers of `sighting` are used again.
void observe(const HeightMap& map, const NoiseModel& noise, const Spline& spline,
             std::span<const PredictedPixel> pixels, const Gates& gates, const Extent& extent, Sighting& sighting);

}  // namespace tubetrack
