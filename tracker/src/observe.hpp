#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "choose_pixels.hpp"
#include "stretch_sums.hpp"
#include "tubetrack/sensors/disparity_levels.hpp"
#include "tubetrack/tracker/predict.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// The reading without the bias of its rounding and of the jitter.
inline double unbiased_m(const DisparityLevels& levels, const PredictedPixel& pixel, float measured_m) {
  return depth_of_level_m(levels, measured_m) - pixel.jitter_bias_m;
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
  // Scratch of `observe`.
  ChosenPixels chosen;
  RecycledVector<ObservedPoint> origin_m;  ///< of each span, without weight
  RecycledVector<std::size_t> near_next, far_next;
};

/// The pixels must be predicted on this centreline. Buffers of `sighting` are used again.
void observe(const HeightMap& map, const NoiseModel& noise, const Spline& spline, const PredictedPixels& pixels,
             const Gates& gates, const Extent& extent, Sighting& sighting);

}  // namespace tubetrack
