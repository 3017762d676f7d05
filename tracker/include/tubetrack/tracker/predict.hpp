#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
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

/// Predicted pixels, side by side as vectors take them: each column holds one number of all pixels, and has room for a
/// vector more than there are. Whoever reads them one by one has them as PredictedPixel.
struct PredictedPixels {
  static constexpr std::size_t kSpare = 16;

  RecycledVector<std::size_t> rows;  ///< where those of each row of the image begin
  RecycledVector<std::uint32_t> cell;
  RecycledVector<float> depth_m, t, cos_incidence, lateral, axis_depth_m, across, margin_px, jitter_bias_m, sigma_m;
  std::size_t count = 0;

  std::size_t size() const { return count; }
  bool empty() const { return count == 0; }
  /// Behind the last pixel of the k-th of the rows.
  std::size_t end_of_row(std::size_t k) const { return k + 1 < rows.size() ? rows[k + 1] : count; }
  PredictedPixel operator[](std::size_t i) const {
    return {cell[i],         depth_m[i], t[i],         cos_incidence[i], lateral[i],
            axis_depth_m[i], across[i],  margin_px[i], jitter_bias_m[i], sigma_m[i]};
  }
  /// Columns for at least so many; what is in them stays.
  void make_room(std::size_t pixels);

  class Iterator {
   public:
    using iterator_category = std::input_iterator_tag;  // it makes what it gives
    using value_type = PredictedPixel;
    using difference_type = std::ptrdiff_t;
    using pointer = const PredictedPixel*;
    using reference = PredictedPixel;

    Iterator(const PredictedPixels& pixels, std::size_t at) : pixels_(&pixels), at_(at) {}
    PredictedPixel operator*() const { return (*pixels_)[at_]; }
    Iterator& operator++() {
      ++at_;
      return *this;
    }
    Iterator operator++(int) {
      const Iterator before = *this;
      ++at_;
      return before;
    }
    bool operator==(const Iterator& other) const { return at_ == other.at_; }

   private:
    const PredictedPixels* pixels_;
    std::size_t at_;
  };
  Iterator begin() const { return {*this, 0}; }
  Iterator end() const { return {*this, count}; }
};

/// Every pixel whose ray meets the tube, once each, in cell order; with `stride` every so manieth in either direction.
/// Includes pixels without a return.
PredictedPixels predict_pixels(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, int stride = 1);
/// The same into a buffer that is used again: fresh memory of this size costs as much as what is written to it. The
/// line is taken as straight, which is quicker, where it is to within so many radii; in any case over half a span,
/// which in a bend of 5 R bulges by 0.01 R.
void predict_pixels(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, int stride,
                    PredictedPixels& pixels, double straight_radii = 0.0);

/// The pixels to fit: predicted incidence below 75° and so far inside the silhouette that the lateral jitter doesn't
/// reach it (chosen by prediction, never by residual beyond the gate that keeps other surfaces out), reading within
/// gate_m + gate_sigmas·σ of the prediction. The jitter's bias is taken off. Only those predicted inside `extent`.
RecycledVector<Observation> select_observations(const HeightMap& map, const NoiseModel& noise,
                                                const PredictedPixels& predicted, double gate_m, double gate_sigmas,
                                                const Extent& extent = kWholeTube);

}  // namespace tubetrack
