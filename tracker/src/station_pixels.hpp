#pragma once

#include <array>
#include <span>

#include "shape_sums.hpp"
#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {

/// What the pixels of one station are.
enum class PixelKind : std::size_t { no_reading, agrees, before, behind, anothers };
struct StationPixels {
  std::array<int, 5> count{};  ///< of each kind, of those that see the tube at less than 75°
  ShapeSums shape;

  int of(PixelKind kind) const { return count[static_cast<std::size_t>(kind)]; }
};

/// Takes the pixels of a tube of this radius into its stations, `per_span` of which stand on each span of its spline.
/// `depth_m`: the map's readings, a cell each; 0 none, below it another tube's.
void take_pixels(const float* depth_m, double radius_m, const PredictedPixels& pixels, double per_span,
                 std::span<StationPixels> stations);

}  // namespace tubetrack
