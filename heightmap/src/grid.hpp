#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tubetrack {

/// Cells beside the image in every row of the surfel stage's own arrays, so that a vector may start or end there. They
/// hold no reading.
inline constexpr int kMargin_px = 64;

/// Rows of padded cells: column u of the image is column u + kMargin_px.
struct Grid {
  int width = 0;
  int height = 0;

  int stride() const { return (width + 63) / 64 * 64 + 2 * kMargin_px; }
  int words() const { return stride() / 64; }
  std::size_t size() const { return static_cast<std::size_t>(stride()) * static_cast<std::size_t>(height); }
  /// Place among the rows of tiles, one after the other (of a row of the image as many as there are columns of tiles).
  std::size_t tile(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>((width + 15) / 16) + static_cast<std::size_t>(u / 16);
  }
  std::size_t at(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(stride()) + static_cast<std::size_t>(u + kMargin_px);
  }
};

/// Inverse depth and its variance as integers: sums over windows are then exact, and the same wherever they start.
/// Sums are taken modulo 2³²; those over a window of 21 × 21 cells fit 31 bits.
inline constexpr float kHeightUnit_per_m = 1.0F / 65536.0F;             // 2⁻¹⁶ /m, a 30th of the noise at its least
inline constexpr float kVarianceUnit_per_m2 = 1.0F / 2147483648.0F;     // 2⁻³¹ /m²
inline constexpr std::int32_t kHeightLimit = 12 * 65536;                // 83 mm; nearer cells hold no height here
inline constexpr std::int32_t kVarianceLimit = 2147483647 / (21 * 21);  // at 0.19 m, with the least noise of all

/// Heights in these units, 0: none.
struct Heights {
  Grid grid;
  std::vector<std::uint16_t> steady;  ///< a bit each for the 16 cells of a row of a tile: was steady when it was taken
  std::vector<std::int32_t> height;
  std::vector<std::int32_t> variance;
};

}  // namespace tubetrack
