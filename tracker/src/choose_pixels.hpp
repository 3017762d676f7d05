#pragma once

#include <cstddef>
#include <cstdint>

#include "stretch_sums.hpp"
#include "tubetrack/sensors/disparity_levels.hpp"
#include "tubetrack/tracker/predict.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// Readings of predicted pixels, ready to be sorted by stretch. Every column has room for a vector more than there are.
struct ChosenPixels {
  static constexpr std::size_t kSpare = 16;

  RecycledVector<std::uint32_t> place;   ///< twice the number of the stretch, and 1 more for a reading that is near
  RecycledVector<ObservedPoint> points;  ///< from the camera
  RecycledVector<ObservedRay> rays;
  std::size_t count = 0;

  void make_room(std::size_t pixels);
};

/// Which pixels are chosen: readings within near_m or far_m, each with so many σ more, of the prediction.
struct PixelChoice {
  const float* depth_m = nullptr;  ///< the map's readings, a cell each; none at 0 and below
  const float* rays = nullptr;     ///< the map's rays, x and y of each cell
  std::size_t cells = 0;           ///< of the map
  DisparityLevels levels;
  float near_m = 0.0F;
  float far_m = 0.0F;
  float sigmas = 0.0F;
  float least_margin_px = 0.0F;
  float t_begin = 0.0F;
  float t_end = 0.0F;
  int stretches = 0;
};

/// Of the pixels those that may be fitted, in their order.
void choose_pixels(const PixelChoice& choice, const PredictedPixels& pixels, ChosenPixels& chosen);

}  // namespace tubetrack
