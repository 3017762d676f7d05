#include "surfel_region.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace tubetrack {

namespace {

constexpr int kLargestHalf_px = kWindowHalfSizes_px.back();
/// How far beside a region planes and sums are made: within reach, and a multiple of every vector's length.
constexpr int kPlanesReach_px = 16;
constexpr int kSumsReach_px = 32;
static_assert(kPlanesReach_px >= kLargestHalf_px && kSumsReach_px > kPlanesReach_px + kLargestHalf_px);
static_assert(kMargin_px >= kSumsReach_px);

/// Clears the bits of columns outside [begin, end).
void keep_columns(BitImage& image, int v, int begin, int end) {
  std::uint64_t* row = image.row(v);
  for (int i = 0; i < image.grid.words(); ++i) {
    const int first = 64 * i - kMargin_px;  // column of the word's lowest bit
    const int below = std::clamp(begin - first, 0, 64);
    const int count = std::clamp(end - first, 0, 64);
    const std::uint64_t from = below == 64 ? 0 : ~std::uint64_t{0} << below;
    const std::uint64_t to = count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
    row[i] &= from & to;
  }
}

void flag_holes(int v_begin, int v_end, SurfelWork& work) {
  static_assert(kSumBlock_px == 32 && kSumBlock_px > 2 * kLargestHalf_px);
  const int words = work.missing.grid.words();
  const int blocks = 2 * words;
  for (int v = v_begin; v < v_end; ++v) {
    const std::uint64_t* missing = work.missing.row(v);
    std::uint8_t* out = work.beside_holes.data() + static_cast<std::ptrdiff_t>(v) * blocks;
    std::fill_n(out, blocks, std::uint8_t{0});
    for (int i = 0; i < words; ++i) {
      if (static_cast<std::uint32_t>(missing[i]) != 0) out[2 * i - (i > 0 ? 1 : 0)] = out[2 * i] = out[2 * i + 1] = 1;
      if (missing[i] >> 32 != 0) out[2 * i] = out[2 * i + 1] = out[2 * i + (i + 1 < words ? 2 : 1)] = 1;
    }
  }
}

void spread_hole_flags(int v_begin, int v_end, SurfelWork& work) {
  const int blocks = 2 * work.missing.grid.words();
  for (int v = v_begin; v < v_end; ++v) {
    std::uint8_t* out = work.near_holes.data() + static_cast<std::ptrdiff_t>(v) * blocks;
    std::fill_n(out, blocks, std::uint8_t{0});
    for (int k = std::max(0, v - kSurfelReach_px); k <= std::min(work.missing.grid.height - 1, v + kSurfelReach_px); ++k) {
      const std::uint8_t* in = work.beside_holes.data() + static_cast<std::ptrdiff_t>(k) * blocks;
      for (int i = 0; i < blocks; ++i) out[i] |= in[i];
    }
  }
}

/// Puts the new surfels of a row in the place of those that the region had.
void replace_found(const Region& region, int v, SurfelWork& work) {
  FoundSurfel* row = work.found.get() + static_cast<std::ptrdiff_t>(v) * work.heights.grid.width;
  int& count = work.found_count[static_cast<std::size_t>(v)];
  const auto column_less = [](const FoundSurfel& surfel, int u) { return surfel.u < u; };
  FoundSurfel* first = std::lower_bound(row, row + count, region.u_begin, column_less);
  FoundSurfel* last = std::lower_bound(first, row + count, region.u_end, column_less);
  const int word_begin = (region.u_begin + kMargin_px) / 64;
  const int word_end = (region.u_end + kMargin_px + 63) / 64;
  int fresh = 0;
  for (int i = word_begin; i < word_end; ++i) fresh += std::popcount(work.row_found[static_cast<std::size_t>(i)]);
  std::memmove(first + fresh, last, static_cast<std::size_t>(row + count - last) * sizeof(FoundSurfel));
  count += fresh - static_cast<int>(last - first);
  for (int i = word_begin; i < word_end; ++i) {
    for (std::uint64_t bits = work.row_found[static_cast<std::size_t>(i)]; bits != 0; bits &= bits - 1) {
      *first++ = work.row_surfels[static_cast<std::size_t>(64 * i + std::countr_zero(bits) - kMargin_px)];
    }
  }
}

}  // namespace

void prepare(const HeightMap& map, SurfelWork& work) {
  const Grid grid{map.intrinsics.width, map.intrinsics.height};
  work.heights.grid = grid;
  // A vector that starts in a row's last cell reads on.
  work.heights.height.assign(grid.size() + 64, 0);
  work.heights.variance.assign(grid.size() + 64, 0);
  work.longest_ray2 = 0.0F;
  for (const Eigen::Vector2f& ray : map.rays) work.longest_ray2 = std::max(work.longest_ray2, ray.squaredNorm());
  if (map.intrinsics.has_distortion()) {
    const auto with_guards = grid.size() + 2 * static_cast<std::size_t>(grid.stride());
    work.rays.x.assign(with_guards, 0.0F);
    work.rays.y.assign(with_guards, 0.0F);
    for (int v = 0; v < grid.height; ++v) {
      for (int u = 0; u < grid.width; ++u) {
        work.rays.x[RayTable::at(grid, u, v)] = map.rays[map.cell(u, v)].x();
        work.rays.y[RayTable::at(grid, u, v)] = map.rays[map.cell(u, v)].y();
      }
    }
  }
  const auto blocks = static_cast<std::size_t>(2 * grid.words() * grid.height);
  work.beside_holes.assign(blocks, 0);
  work.near_holes.assign(blocks, 0);
  work.edges.resize(grid);
  for (BitImage* image : {&work.missing, &work.spread}) image->resize(grid);
  for (Windows& windows : work.windows) {
    windows.fits.resize(grid);
    windows.holes.resize(grid);
  }
  work.row_found.assign(static_cast<std::size_t>(grid.words()), 0);
  work.row_surfels.resize(static_cast<std::size_t>(grid.stride()));
  // Not set, so that memory is taken only where there are surfels.
  work.found = std::make_unique_for_overwrite<FoundSurfel[]>(map.rays.size());
  work.found_count.assign(static_cast<std::size_t>(grid.height), 0);
}

void fit_windows(const EdgeRule& rule, int v_begin, int v_end, SurfelWork& work) {
  const Grid& grid = work.heights.grid;
  const int v_first = std::max(0, v_begin - kLargestHalf_px);
  const int v_last = std::min(grid.height, v_end + kLargestHalf_px);
  find_edges(work.heights, rule, v_first, v_last, work.edges);
  for (int v = v_first; v < v_last; ++v) {
    for (int i = 0; i < grid.words(); ++i) work.missing.row(v)[i] = ~work.edges.valid.row(v)[i];
    keep_columns(work.missing, v, 0, grid.width);
  }
  flag_holes(v_first, v_last, work);
  spread_hole_flags(v_begin, v_end, work);
  for (std::size_t size = 0; size < kWindowSizes; ++size) {
    const int half = kWindowHalfSizes_px[size];
    Windows& windows = work.windows[size];
    spread_in_rows(work.missing, half, v_first, v_last, work.spread);
    spread_over_rows(work.spread, half, v_begin, v_end, windows.holes);
    spread_in_rows(work.edges.edges, half, v_first, v_last, work.spread);
    spread_over_rows(work.spread, half, v_begin, v_end, windows.fits);
    for (int v = v_begin; v < v_end; ++v) {
      std::uint64_t* fits = windows.fits.row(v);
      const std::uint64_t* valid = work.edges.valid.row(v);
      const bool inside = v >= half && v < grid.height - half;
      for (int i = 0; i < grid.words(); ++i) fits[i] = inside ? valid[i] & ~fits[i] : 0;
      keep_columns(windows.fits, v, half, grid.width - half);
    }
  }
}

void find_in_region(const SurfelRule& rule, const Region& region, SurfelWork& work) {
  const Grid& grid = work.heights.grid;
  const int columns = region.u_end - region.u_begin;
  const int sums_begin = region.u_begin - kSumsReach_px;
  work.sums.start(sums_begin, columns + 2 * kSumsReach_px);
  for (std::size_t size = 0; size < kWindowSizes; ++size) {
    work.planes[size].start(kWindowHalfSizes_px[size], region.u_begin - kPlanesReach_px, columns + 2 * kPlanesReach_px);
  }
  int summed = std::max(0, region.v_begin - kSurfelReach_px);
  for (int v = region.v_begin - kSurfelReach_px; v < region.v_end; ++v) {
    for (; summed < std::min(grid.height, v + kSurfelReach_px + 1); ++summed) {
      const std::uint8_t* near_holes = work.near_holes.data() +
                                       static_cast<std::ptrdiff_t>(summed) * grid.stride() / kSumBlock_px +
                                       (sums_begin + kMargin_px) / kSumBlock_px;
      work.sums.add_row(work.heights, summed, near_holes);
    }
    for (std::size_t size = kWindowSizes; size-- > 0;) {
      const int half = kWindowHalfSizes_px[size];
      if (v + 2 * half < region.v_begin) continue;
      planes_of_row(work.sums, work.windows[size].fits, work.windows[size].holes, v + half, work.planes[size]);
    }
    if (v < region.v_begin) continue;
    std::fill(work.row_found.begin(), work.row_found.end(), std::uint64_t{0});
    for (std::size_t size = kWindowSizes; size-- > 0;) {
      surfels_of_row(rule, work.planes[size], work.rays, grid, v, region.u_begin, region.u_end, work.row_found.data(),
                     work.row_surfels.data());
    }
    replace_found(region, v, work);
  }
}

}  // namespace tubetrack
