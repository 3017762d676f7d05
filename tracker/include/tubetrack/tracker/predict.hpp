#pragma once

#include <cstdint>
#include <limits>

#include "tubetrack/heightmap/height_map.hpp"
#include "tubetrack/tracker/fit.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// Pixels that see the surface at a smaller cosine of incidence, beyond 75°, are neither fitted nor judged by.
inline constexpr float kCos75 = 0.2588F;

/// A stretch of the centreline, in spans.
struct Extent {
  double t_begin = 0.0;
  double t_end = 0.0;
};
inline constexpr Extent kWholeTube{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};

/// Where one pixel's ray meets the model.
struct PredictedPixel {
  std::uint32_t cell = 0;
  float depth_m = 0.0F;        ///< z of the nearest intersection
  float t = 0.0F;              ///< place on the centreline
  float cos_incidence = 0.0F;  ///< between ray and surface normal, > 0
  float lateral = 0.0F;        ///< −1 … 1: sideways from the axis as seen from the camera, in radii
  float axis_depth_m = 0.0F;   ///< z at which the ray is nearest to the axis
  float across = 0.0F;         ///< metres across the axis for one metre of z along the ray
  float margin_px = 0.0F;      ///< to the silhouette, across the tube
  float jitter_bias_m = 0.0F;  ///< mean of a reading less the surface's depth: the lateral jitter on a curved surface
  float sigma_m = 0.0F;        ///< of a reading there, along z (DESIGN §2: axial noise, and lateral jitter on a slope)
};

/// Every pixel whose ray meets the tube, once each, in cell order; with `stride` every so manieth in either direction.
/// Includes pixels without a return.
RecycledVector<PredictedPixel> predict_pixels(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                                              int stride = 1);
/// The same into a buffer that is used again: fresh memory of this size costs as much as what is written to it.
void predict_pixels(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, int stride,
                    RecycledVector<PredictedPixel>& pixels);

/// The pixels to fit: predicted incidence below 75° and so far inside the silhouette that the lateral jitter doesn't
/// reach it (chosen by prediction, never by residual beyond the gate that keeps other surfaces out), reading within
/// gate_m + gate_sigmas·σ of the prediction. The jitter's bias is taken off. Only those predicted inside `extent`.
RecycledVector<Observation> select_observations(const HeightMap& map, const NoiseModel& noise,
                                                const RecycledVector<PredictedPixel>& predicted, double gate_m,
                                                double gate_sigmas, const Extent& extent = kWholeTube);

}  // namespace tubetrack
