#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stretch_sums.hpp"
#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {

/// How far inside the silhouette a pixel must be, so that what jitters across it neither comes in nor is missing.
float least_margin_px(const NoiseModel& noise);

/// A reading back at its disparity level, the jitter's bias taken off.
inline double unbiased_m(const HeightMap& map, const NoiseModel& noise, const PredictedPixel& pixel, float measured_m) {
  const double reading_m = map.at_disparity_levels ? depth_of_level_m(noise, measured_m) : measured_m;
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
  std::vector<Chosen> chosen;
  std::vector<std::size_t> near_next, far_next;
};

/// The pixels must be predicted on this centreline. Buffers of `sighting` are used again.
void observe(const HeightMap& map, const NoiseModel& noise, const Spline& spline,
             std::span<const PredictedPixel> pixels, const Gates& gates, const Extent& extent, Sighting& sighting);

}  // namespace tubetrack
