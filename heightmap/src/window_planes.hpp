#pragma once

#include <cstdint>
#include <vector>

#include "bit_image.hpp"
#include "window_sums.hpp"

namespace tubetrack {

/// In `slope_u` where there is no plane.
inline constexpr float kNoPlane = 1e30F;

/// One row of least-squares planes w = height + slope_u du + slope_v dv over windows, w the inverse depth, (du, dv) the
/// pixels from the window's middle. For a camera without distortion that is a plane in space.
struct PlaneRow {
  float* slope_u = nullptr;  ///< 1/m per pixel
  float* slope_v = nullptr;
  float* slope_sigma = nullptr;  ///< of the less certain slope
  float* height = nullptr;       ///< 1/m
};

/// The planes of one window size in a strip of columns, the last rows only.
class PlaneRing {
 public:
  void start(int half_px, int u_begin, int columns);
  PlaneRow row(int v);
  int half_px() const { return half_px_; }
  int index(int u) const { return u - u_begin_; }
  int u_begin() const { return u_begin_; }
  int columns() const { return columns_; }

 private:
  int half_px_ = 0;
  int u_begin_ = 0;
  int columns_ = 0;
  unsigned rows_ = 0;
  std::vector<float> ring_;
};

/// Planes of row `v`, columns [u_begin, u_end), which are multiples of 16, where `fits` has a bit; `holes` has one
/// where a cell of the window has no height.
void planes_of_row(const WindowSums& sums, const BitImage& fits, const BitImage& holes, int v, int u_begin, int u_end,
                   PlaneRing& planes);

}  // namespace tubetrack
