#pragma once

#include <cstdint>
#include <vector>

#include "grid.hpp"

namespace tubetrack {

/// What is summed over windows: height h, variance, u h, v h (u, v the pixel, so that a window's own coordinates are a
/// subtraction away), and, where cells may be without height, the moments of those that have one.
enum SumChannel : int { kH, kVariance, kUH, kVH, kCount, kU, kV, kUU, kUV, kVV, kSumChannels };

/// Columns that are summed with the moments of the cells that have a height, or without, together.
inline constexpr int kSumBlock_px = 32;

/// Summed-area table of a strip of columns, of its last rows only. Row v holds sums over the rows up to v − 1, entry
/// u those over the columns up to u − 1, modulo 2³². From where they run does not matter: only differences are used,
/// over windows.
class WindowSums {
 public:
  /// `u_begin` and `columns` are multiples of kSumBlock_px.
  void start(int u_begin, int columns);
  /// Adds columns [u_begin, u_end), whole blocks, of row v, after which row v + 1 can be read, for windows that lie in
  /// such columns with all of their rows. The channels from kCount on are right only for windows all of whose blocks
  /// are `near_holes` in all of their rows; a flag a block, from the first.
  void add_row(const Heights& heights, int v, int u_begin, int u_end, const std::uint8_t* near_holes);

  const std::uint32_t* row(int v) const { return ring_.data() + offset(v); }
  std::size_t stride() const { return stride_; }  ///< from one channel of a row to the next
  /// Where column u is in a row.
  int index(int u) const { return u - u_begin_; }

 private:
  static constexpr unsigned kRows = 22;  // the largest window's, and 1
  std::size_t offset(int v) const { return static_cast<unsigned>(v) % kRows * kSumChannels * stride_; }

  int u_begin_ = 0;
  std::size_t stride_ = 0;
  std::vector<std::uint32_t> ring_;
};

}  // namespace tubetrack
