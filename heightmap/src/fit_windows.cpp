#include "fit_windows.hpp"

#include <algorithm>

namespace tubetrack {

namespace {

static_assert(kSumBlock_px == 32 && kSumBlock_px > 2 * kLargestHalf_px);

std::uint8_t* blocks_of_row(std::vector<std::uint8_t>& flags, const Grid& grid, int v) {
  return flags.data() + static_cast<std::ptrdiff_t>(v) * 2 * grid.words();
}

/// Blocks up to a window away from a hole, up and down.
void spread_hole_flags(const WordArea& area, WindowFits& out) {
  const Grid& grid = out.missing.grid;
  for (int v = area.v_begin; v < area.v_end; ++v) {
    std::uint8_t* near = blocks_of_row(out.near_holes, grid, v);
    std::fill(near + 2 * area.word_begin, near + 2 * area.word_end, std::uint8_t{0});
    const int last = std::min(grid.height - 1, v + 2 * kLargestHalf_px);
    for (int k = std::max(0, v - 2 * kLargestHalf_px); k <= last; ++k) {
      const std::uint8_t* beside = blocks_of_row(out.beside_holes, grid, k);
      for (int i = 2 * area.word_begin; i < 2 * area.word_end; ++i) near[i] |= beside[i];
    }
  }
}

}  // namespace

void WindowFits::resize(const Grid& grid) {
  edges.resize(grid);
  missing.resize(grid);
  for (Windows& size : windows) {
    size.fits.resize(grid);
    size.holes.resize(grid);
  }
  const auto blocks = 2 * static_cast<std::size_t>(grid.words()) * static_cast<std::size_t>(grid.height);
  beside_holes.assign(blocks, 0);
  near_holes.assign(blocks, 0);
}

void compare_cells(const Heights& heights, const EdgeRule& rule, const WordArea& area, WindowFits& out) {
  compare_neighbours(heights, rule, area, out.edges);
  for (int v = area.v_begin; v < area.v_end; ++v) {
    for (int i = area.word_begin; i < area.word_end; ++i) out.missing.row(v)[i] = ~out.edges.valid.row(v)[i];
  }
  keep_columns(0, heights.grid.width, area, out.missing);
}

void find_borders(const Heights& heights, const EdgeRule& rule, const WordArea& area, WindowFits& out) {
  find_edges(heights, rule, area, out.edges);
  for (int v = area.v_begin; v < area.v_end; ++v) {
    const std::uint64_t* missing = out.missing.row(v);
    std::uint8_t* beside = blocks_of_row(out.beside_holes, heights.grid, v);
    for (int i = area.word_begin; i < area.word_end; ++i) {
      const bool low = static_cast<std::uint32_t>(missing[i]) != 0;
      const bool high = missing[i] >> 32 != 0;
      beside[2 * i] = low || high || missing[i - 1] >> 32 != 0 ? 1 : 0;
      beside[2 * i + 1] = low || high || static_cast<std::uint32_t>(missing[i + 1]) != 0 ? 1 : 0;
    }
  }
}

void fit_windows(const WordArea& area, WindowFits& out, BitImage& spread) {
  const Grid& grid = out.missing.grid;
  const WordArea rows{std::max(0, area.v_begin - kLargestHalf_px), std::min(grid.height, area.v_end + kLargestHalf_px),
                      area.word_begin, area.word_end};
  for (std::size_t size = 0; size < kWindowSizes; ++size) {
    const int half = kWindowHalfSizes_px[size];
    Windows& windows = out.windows[size];
    spread_in_rows(out.missing, half, rows, spread);
    spread_over_rows(spread, half, area, windows.holes);
    spread_in_rows(out.edges.edges, half, rows, spread);
    spread_over_rows(spread, half, area, windows.fits);
    for (int v = area.v_begin; v < area.v_end; ++v) {
      const std::uint64_t* valid = out.edges.valid.row(v);
      std::uint64_t* fits = windows.fits.row(v);
      const bool inside = v >= half && v < grid.height - half;
      for (int i = area.word_begin; i < area.word_end; ++i) fits[i] = inside ? valid[i] & ~fits[i] : 0;
    }
    keep_columns(half, grid.width - half, area, windows.fits);
  }
  spread_hole_flags(area, out);
}

}  // namespace tubetrack
