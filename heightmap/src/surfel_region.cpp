#include "surfel_region.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace tubetrack {

namespace {

/// How far beside a region planes and sums are made: within reach, and a multiple of every vector's length.
constexpr int kPlanesReach_px = 16;
constexpr int kSumsReach_px = 27;
static_assert(kPlanesReach_px >= kLargestHalf_px && kSumsReach_px > kPlanesReach_px + kLargestHalf_px);
static_assert(kMargin_px >= kSumsReach_px + kSumBlock_px);

WordArea words_of(const Region& region) {
  return {region.v_begin, region.v_end, (region.u_begin + kMargin_px) / 64, (region.u_end + kMargin_px + 63) / 64};
}

/// Puts the new surfels of a row in the place of those that the region had.
void replace_found(const Region& region, int v, SurfelWork& work) {
  FoundSurfel* row = work.found.get() + static_cast<std::ptrdiff_t>(v) * work.heights.grid.width;
  int& count = work.found_count[static_cast<std::size_t>(v)];
  const auto column_less = [](const FoundSurfel& surfel, int u) { return surfel.u < u; };
  FoundSurfel* first = std::lower_bound(row, row + count, region.u_begin, column_less);
  FoundSurfel* last = std::lower_bound(first, row + count, region.u_end, column_less);
  const int word_begin = words_of(region).word_begin;
  const int word_end = words_of(region).word_end;
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

void find_in_region(const SurfelRule& rule, const Region& region, SurfelWork& work) {
  const Grid& grid = work.heights.grid;
  const int u_end = (region.u_end + 15) / 16 * 16;
  const int columns = u_end - region.u_begin + 2 * kPlanesReach_px;
  // Sums are made in whole blocks.
  const int sums_begin = (region.u_begin + kMargin_px - kSumsReach_px) / kSumBlock_px * kSumBlock_px - kMargin_px;
  const int sums_end =
      (u_end + kMargin_px + kSumsReach_px + kSumBlock_px - 1) / kSumBlock_px * kSumBlock_px - kMargin_px;
  work.sums.start(sums_begin, sums_end - sums_begin);
  for (std::size_t size = 0; size < kWindowSizes; ++size) {
    work.planes[size].start(kWindowHalfSizes_px[size], region.u_begin - kPlanesReach_px, columns);
  }
  int summed = std::max(0, region.v_begin - kSurfelReach_px);
  for (int v = region.v_begin - kSurfelReach_px; v < region.v_end; ++v) {
    for (; summed < std::min(grid.height, v + kSurfelReach_px + 1); ++summed) {
      work.sums.add_row(work.heights, summed, work.fits.near_holes_from(sums_begin, summed));
    }
    for (std::size_t size = kWindowSizes; size-- > 0;) {
      const int half = kWindowHalfSizes_px[size];
      if (v + 2 * half < region.v_begin) continue;
      const Windows& windows = work.fits.windows[size];
      planes_of_row(work.sums, windows.fits, windows.holes, v + half, work.planes[size]);
    }
    if (v < region.v_begin) continue;
    std::fill(work.row_found.begin(), work.row_found.end(), std::uint64_t{0});
    for (std::size_t size = kWindowSizes; size-- > 0;) {
      surfels_of_row(rule, work.planes[size], work.rays, grid, v, region.u_begin, u_end, work.candidates.data(),
                     work.row_found.data(), work.row_surfels.data());
    }
    replace_found(region, v, work);
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
  work.fits.resize(grid);
  work.row_found.assign(static_cast<std::size_t>(grid.words()), 0);
  work.candidates.resize(static_cast<std::size_t>(grid.stride()));
  work.row_surfels.resize(static_cast<std::size_t>(grid.stride()));
  // Not set, so that memory is taken only where there are surfels.
  work.found = std::make_unique_for_overwrite<FoundSurfel[]>(map.rays.size());
  work.found_count.assign(static_cast<std::size_t>(grid.height), 0);
}

void find_in_regions(const SurfelRule& rule, const EdgeRule& edge_rule, std::span<const Region> regions,
                     SurfelWork& work) {
  for (const Region& region : regions) compare_cells(work.heights, edge_rule, words_of(region), work.fits);
  for (const Region& region : regions) find_borders(work.heights, edge_rule, words_of(region), work.fits);
  for (const Region& region : regions) fit_windows(words_of(region), work.fits);
  for (const Region& region : regions) find_in_region(rule, region, work);
}

}  // namespace tubetrack
