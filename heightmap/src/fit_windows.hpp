#pragma once

#include <array>
#include <vector>

#include "edges.hpp"
#include "tubetrack/heightmap/normals.hpp"
#include "window_sums.hpp"

namespace tubetrack {

inline constexpr std::size_t kWindowSizes = kWindowHalfSizes_px.size();
inline constexpr int kLargestHalf_px = kWindowHalfSizes_px.back();

/// Windows of one size, by the cell in their middle.
struct Windows {
  BitImage fits;   ///< the window stays on one side of edges and within the image
  BitImage holes;  ///< a cell of it has no height
};

/// Buffers of `fit_windows`.
struct SpreadWork {
  std::array<BitImage, 2> spread;
  std::vector<std::uint8_t> holes_around;  ///< by block

  void resize(const Grid& grid);
};

struct WindowFits {
  Edges edges;
  BitImage missing;  ///< cells of the image without height
  std::array<Windows, kWindowSizes> windows;
  /// By row and block of kSumBlock_px columns, from padded column 0: a hole in the block or the one beside it; and such
  /// a hole in any row that a window shares with this one.
  std::vector<std::uint8_t> beside_holes;
  std::vector<std::uint8_t> near_holes;

  void resize(const Grid& grid);
  /// Flags of row v, from the block that starts at column u on.
  const std::uint8_t* near_holes_from(int u, int v) const {
    return near_holes.data() + static_cast<std::ptrdiff_t>(missing.grid.at(u, v)) / kSumBlock_px;
  }
};

/// The three steps to where windows fit in an area, each from what the one before left in it and around: first what two
/// neighbours say, then edges and blocks beside holes, then windows. Areas that are worked on together go through each
/// step together.
void compare_cells(const Heights& heights, const EdgeRule& rule, const WordArea& area, WindowFits& out);
void find_borders(const Heights& heights, const EdgeRule& rule, const WordArea& area, WindowFits& out);
void fit_windows(const WordArea& area, WindowFits& out, SpreadWork& work);

}  // namespace tubetrack
