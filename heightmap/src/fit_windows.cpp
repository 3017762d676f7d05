#include "fit_windows.hpp"

#include <algorithm>

namespace tubetrack {

namespace {

static_assert(kSumBlock_px == 32 && kSumBlock_px > 2 * kLargestHalf_px);
// Each size goes on from the one before.
static_assert(kWindowHalfSizes_px[1] <= 2 * kWindowHalfSizes_px[0] &&
              kWindowHalfSizes_px[2] <= 2 * kWindowHalfSizes_px[1]);

std::uint8_t* blocks_of_row(std::vector<std::uint8_t>& flags, const Grid& grid, int v) {
  return flags.data() + static_cast<std::ptrdiff_t>(v) * 2 * grid.words();
}

/// Blocks up to a window away from a hole, up and down: with a count of those in the rows around, by block.
void spread_hole_flags(const WordArea& area, WindowFits& out, std::vector<std::uint8_t>& count) {
  const Grid& grid = out.missing.grid;
  const auto begin = 2 * area.word_begin;
  const auto end = 2 * area.word_end;
  count.assign(std::size_t{2} * static_cast<std::size_t>(grid.words()), 0);
  const auto add = [&](int v, std::uint8_t sign) {
    if (v < 0 || v >= grid.height) return;
    const std::uint8_t* beside = blocks_of_row(out.beside_holes, grid, v);
    for (int i = begin; i < end; ++i) count[static_cast<std::size_t>(i)] += static_cast<std::uint8_t>(sign * beside[i]);
  };
  constexpr int kAway_px = 2 * kLargestHalf_px;
  for (int v = area.v_begin - kAway_px; v < area.v_begin + kAway_px; ++v) add(v, 1);
  for (int v = area.v_begin; v < area.v_end; ++v) {
    add(v + kAway_px, 1);
    std::uint8_t* near = blocks_of_row(out.near_holes, grid, v);
    for (int i = begin; i < end; ++i) near[i] = count[static_cast<std::size_t>(i)] != 0 ? 1 : 0;
    add(v - kAway_px, 255);
  }
}

/// For each size of windows, the cells that have a bit of `from` in theirs.
void spread_over_windows(const BitImage& from, const WordArea& area, BitImage Windows::* to, SpreadWork& work,
                         WindowFits& out) {
  for (std::size_t size = 0; size < kWindowSizes; ++size) {
    const int half = kWindowHalfSizes_px[size];
    const int beside = kLargestHalf_px - half;  // the next ones go on from this
    const WordArea rows{std::max(0, area.v_begin - beside), std::min(from.grid.height, area.v_end + beside),
                        area.word_begin - 1, area.word_end + 1};
    BitImage& spread = work.spread[size % 2];
    if (size == 0) {
      spread_over_rows(from, half, rows, spread);
    } else {
      spread_on_over_rows(work.spread[(size - 1) % 2], half - kWindowHalfSizes_px[size - 1], rows, spread);
    }
    BitImage& result = out.windows[size].*to;
    for (int v = area.v_begin; v < area.v_end; ++v) {
      const std::uint64_t* in = spread.row(v);
      std::uint64_t* bits = result.row(v);
      for (int i = area.word_begin; i < area.word_end; ++i) bits[i] = spread_in_row(in + i, half);
    }
  }
}

}  // namespace

void SpreadWork::resize(const Grid& grid) {
  for (BitImage& image : spread) image.resize(grid);
  holes_around.resize(std::size_t{2} * static_cast<std::size_t>(grid.words()));
}

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

void fit_windows(const WordArea& area, WindowFits& out, SpreadWork& work) {
  const Grid& grid = out.missing.grid;
  spread_over_windows(out.missing, area, &Windows::holes, work, out);
  spread_over_windows(out.edges.edges, area, &Windows::fits, work, out);
  for (std::size_t size = 0; size < kWindowSizes; ++size) {
    const int half = kWindowHalfSizes_px[size];
    Windows& windows = out.windows[size];
    for (int v = area.v_begin; v < area.v_end; ++v) {
      const std::uint64_t* valid = out.edges.valid.row(v);
      std::uint64_t* fits = windows.fits.row(v);
      const bool inside = v >= half && v < grid.height - half;
      for (int i = area.word_begin; i < area.word_end; ++i) fits[i] = inside ? valid[i] & ~fits[i] : 0;
    }
    keep_columns(half, grid.width - half, area, windows.fits);
  }
  spread_hole_flags(area, out, work.holes_around);
}

}  // namespace tubetrack
