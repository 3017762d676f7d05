#pragma once

#include <cstdint>
#include <vector>

#include "grid.hpp"

namespace tubetrack {

/// What is summed over windows: height h, variance, u h, v h (u, v the pixel, so that a window's own coordinates are a
/// subtraction away), and, where cells may be without height, the moments of those that have one.
enum SumChannel : int { kH, kVariance, kUH, kVH, kCount, kU, kV, kUU, kUV, kVV, kSumChannels };
inline constexpr int kSumChannelsWithoutHoles = kCount;

/// Summed-area table of a strip of columns, of its last 32 rows only. Row v holds sums over the rows from the start to
/// v − 1, entry u those over the columns from the strip's first to u − 1, modulo 2³².
class WindowSums {
 public:
  void start(int u_begin, int columns, int v_begin, bool holes);
  /// Adds rows up to `v_end` − 1, so that row `v_end` can be read.
  void advance(const Heights& heights, int v_end);

  bool holes() const { return channels_ == kSumChannels; }
  const std::uint32_t* row(int v, int channel) const { return ring_.data() + offset(v, channel); }
  std::size_t stride() const { return stride_; }  ///< from one channel of a row to the next
  /// Where column u is in a row.
  int index(int u) const { return u - u_begin_; }

 private:
  static constexpr unsigned kRows = 32;  // at least two windows of the largest size, halved, and 2
  std::size_t offset(int v, int channel) const {
    return (static_cast<unsigned>(v) % kRows * kSumChannels + static_cast<unsigned>(channel)) * stride_;
  }

  int u_begin_ = 0;
  int columns_ = 0;
  int v_end_ = 0;
  int channels_ = 0;
  std::size_t stride_ = 0;
  std::vector<std::uint32_t> ring_;
};

}  // namespace tubetrack
