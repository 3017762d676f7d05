#include "surfel_region.hpp"

#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <ranges>

namespace tubetrack {

namespace {

/// How far beside a region planes and sums are made: within reach, and a multiple of every vector's length.
constexpr int kPlanesReach_px = 16;
constexpr int kSumsReach_px = 27;
static_assert(kPlanesReach_px >= kLargestHalf_px && kSumsReach_px > kPlanesReach_px + kLargestHalf_px);
static_assert(kMargin_px >= kSumsReach_px + kSumBlock_px);

/// Columns of odd rows are searched by so many at once: a tile's, and every vector's length. Where something is
/// affected up to a tile that is not, what stands beside that in the row above is as it was.
constexpr int kPiece_px = kTileWidth_px;
static_assert(kPiece_px == 16 && kBesidePiece_px < kPiece_px);
/// What is affected begins at even rows, so that of each two both are or neither.
static_assert(kAffectedRows_px % 2 == 0);

WordArea words_of(const Region& region) {
  return {region.v_begin, region.v_end, (region.u_begin + kMargin_px) / 64, (region.u_end + kMargin_px + 63) / 64};
}

bool column_less(const FoundSurfel& surfel, int u) {
  return surfel.u < u;
}

/// Puts the new surfels of a row in the place of those that its columns had.
void replace_found(const Part& columns, int v, const BandWork& band, SurfelWork& work) {
  FoundSurfel* row = work.found.get() + static_cast<std::ptrdiff_t>(v) * work.heights.grid.width;
  int& count = work.found_count[static_cast<std::size_t>(v)];
  FoundSurfel* first = std::lower_bound(row, row + count, columns.begin, column_less);
  FoundSurfel* last = std::lower_bound(first, row + count, columns.end, column_less);
  int fresh = 0;
  for (const std::uint64_t bits : band.row_found) fresh += std::popcount(bits);
  std::memmove(first + fresh, last, static_cast<std::size_t>(row + count - last) * sizeof(FoundSurfel));
  count += fresh - static_cast<int>(last - first);
  for (std::size_t i = 0; i < band.row_found.size(); ++i) {
    for (std::uint64_t bits = band.row_found[i]; bits != 0; bits &= bits - 1) {
      *first++ = band.row_surfels[64 * i + static_cast<std::size_t>(std::countr_zero(bits)) - kMargin_px];
    }
  }
}

Part hull(const Part& a, const Part& b) {
  if (a.begin >= a.end) return b;
  return b.begin >= b.end ? a : Part{std::min(a.begin, b.begin), std::max(a.end, b.end)};
}

Part widened(const Part& part, int by_px) {
  return part.begin >= part.end ? part : Part{part.begin - by_px, (part.end + 15) / 16 * 16 + by_px};
}

/// Of a region's row: the columns whose surfels are found anew; none in rows beyond.
Part affected_columns(const Region& region, const BandWork& band, int v) {
  if (v < region.v_begin || v >= region.v_end) return {};
  return band.affected[static_cast<std::size_t>(v - region.v_begin)];
}

/// The columns in which planes of row `v` are needed: by the surfels of that row, half a window aside, and by those
/// half a window above and below. Whole vectors.
Part plane_columns(const Region& region, const BandWork& band, int v, int half) {
  const Part beyond = hull(affected_columns(region, band, v - half), affected_columns(region, band, v + half));
  return hull(widened(affected_columns(region, band, v), kPlanesReach_px), widened(beyond, 0));
}

/// The columns that take part in windows in one of kAffectedRows_px rows from `v` on: whole blocks.
Part sum_columns(const Region& region, const BandWork& band, int v) {
  Part all;
  for (int row = v - kSurfelReach_px; row < v + kAffectedRows_px + kSurfelReach_px; ++row) {
    all = hull(all, affected_columns(region, band, row));
  }
  if (all.begin >= all.end) return all;
  all = widened(all, kSumsReach_px);
  const auto block = [](int u) { return (u + kMargin_px) / kSumBlock_px * kSumBlock_px - kMargin_px; };
  return {block(all.begin), block(all.end + kSumBlock_px - 1)};
}

/// The columns of a row that are searched: of an even one all; of an odd one, by pieces, where the row above has a
/// surfel in or beside the piece. What curves like a tube does so in both, and most of the image in neither.
void choose_searched(const Part& columns, int v, const SurfelWork& work, BandWork& band) {
  const int u_end = (columns.end + kPiece_px - 1) / kPiece_px * kPiece_px;
  band.searched.clear();
  if (v % 2 == 0) {
    band.searched.push_back({columns.begin, u_end});
    return;
  }
  const FoundSurfel* above = work.found.get() + static_cast<std::ptrdiff_t>(v - 1) * work.heights.grid.width;
  const FoundSurfel* end = above + work.found_count[static_cast<std::size_t>(v - 1)];
  above = std::lower_bound(above, end, columns.begin - kBesidePiece_px, column_less);
  while (above < end && above->u < u_end + kBesidePiece_px) {
    const int first = (above->u - kBesidePiece_px) / kPiece_px * kPiece_px;
    const int last = (above->u + kBesidePiece_px) / kPiece_px * kPiece_px;
    const Part pieces{std::max(columns.begin, first), std::min(u_end, last + kPiece_px)};
    if (!band.searched.empty() && band.searched.back().end >= pieces.begin) {
      band.searched.back().end = pieces.end;
    } else {
      band.searched.push_back(pieces);
    }
    above = std::lower_bound(above + 1, end, last + kPiece_px - kBesidePiece_px, column_less);
  }
}

/// The surfels of one row, from planes that are there.
void find_in_row(const SurfelRule& rule, const Part& columns, int v, BandWork& band, SurfelWork& work) {
  choose_searched(columns, v, work, band);
  std::fill(band.row_found.begin(), band.row_found.end(), std::uint64_t{0});
  for (std::size_t size = kWindowSizes; size-- > 0;) {
    for (const Part& part : band.searched) {
      surfels_of_row(rule, band.planes[size], work.rays, work.heights.grid, v, part.begin, part.end,
                     band.candidates.data(), band.row_found.data(), band.row_surfels.data());
    }
  }
  replace_found(columns, v, band, work);
}

void start_rings(const Part& columns, BandWork& band) {
  const Part all = widened(columns, kSumsReach_px + kSumBlock_px);
  band.sums.start(all.begin, all.end - all.begin);
  for (std::size_t size = 0; size < kWindowSizes; ++size) {
    const Part planes = widened(columns, kPlanesReach_px);
    band.planes[size].start(kWindowHalfSizes_px[size], planes.begin, planes.end - planes.begin);
  }
}

void start_region(const Region& region, const AffectedTiles& affected, BandWork& band) {
  band.affected.clear();
  for (int v = region.v_begin; v < region.v_end; ++v) {
    const bool as_above = v > region.v_begin && v % kAffectedRows_px != 0;
    band.affected.push_back(as_above ? band.affected.back() : affected.columns_of(affected.surfels, region, v));
  }
  start_rings({region.u_begin, region.u_end}, band);
}

void find_in_region(const SurfelRule& rule, const Region& region, const AffectedTiles& affected, BandWork& band,
                    SurfelWork& work) {
  start_region(region, affected, band);
  const int height = work.heights.grid.height;
  const int first_summed = std::max(0, region.v_begin - kSurfelReach_px);
  int summed = first_summed;
  Part sums;
  for (int v = region.v_begin - kSurfelReach_px; v < region.v_end; ++v) {
    for (; summed < std::min(height, v + kSurfelReach_px + 1); ++summed) {
      if ((summed - first_summed) % kAffectedRows_px == 0) sums = sum_columns(region, band, summed);
      if (sums.begin >= sums.end) continue;
      band.sums.add_row(work.heights, summed, sums.begin, sums.end, work.fits.near_holes_from(sums.begin, summed));
    }
    for (std::size_t size = kWindowSizes; size-- > 0;) {
      const int half = kWindowHalfSizes_px[size];
      if (v + 2 * half < region.v_begin) continue;
      const Part columns = plane_columns(region, band, v + half, half);
      if (columns.begin >= columns.end) continue;
      const Windows& windows = work.fits.windows[size];
      planes_of_row(band.sums, windows.fits, windows.holes, v + half, columns.begin, columns.end, band.planes[size]);
    }
    // Rows below are another thread's.
    if (v + 2 >= region.v_begin && v + 2 < region.v_end) fetch_found(work, v + 2);
    const Part columns = affected_columns(region, band, v);
    if (columns.begin < columns.end) find_in_row(rule, columns, v, band, work);
  }
}

/// How much work the regions are in the rows above `v`.
std::int64_t work_above(std::span<const Region> regions, int v) {
  std::int64_t sum = 0;
  for (const Region& r : regions) {
    sum += static_cast<std::int64_t>(r.u_end - r.u_begin + 2 * kSumsReach_px) *
           std::clamp(v - r.v_begin, 0, r.v_end - r.v_begin);
  }
  return sum;
}

/// The i-th of `count` bands of some rows, each of about as much work. All but the first begin at an even row.
Part band_of(std::span<const Region> regions, const Part& rows, int i, int count) {
  const std::int64_t before = work_above(regions, rows.begin);
  const std::int64_t all = work_above(regions, rows.end) - before;
  const auto first_row = [&](int band) {
    const auto of = std::views::iota(rows.begin, rows.end);
    const int first = *std::ranges::partition_point(
        of, [&](int v) { return (work_above(regions, v) - before) * count < all * band; });
    return std::max(rows.begin, first / 2 * 2);
  };
  return {i == 0 ? rows.begin : first_row(i), i + 1 == count ? rows.end : first_row(i + 1)};
}

/// What surfels of some rows depend on in rows beside them: windows that fit, and in these edges and where holes are
/// near, which takes comparing a row more.
constexpr int kWindowsBeside_px = kSurfelReach_px;
constexpr int kEdgesBeside_px = kWindowsBeside_px + kSurfelReach_px;
constexpr int kComparedBeside_px = kEdgesBeside_px + 1;
static_assert(kComparedBeside_px > kSurfelReach_px + kGapLimit_px);

/// Windows are spread over rows from some above and below, so that many rows together are cheaper.
constexpr int kWindowRows_px = 4 * kAffectedRows_px;

/// Does a step in a region where there are flags, so many rows at once.
template <typename Step>
void in_parts(const AffectedTiles& affected, const std::uint8_t* flags, int rows, const Region& region,
              const Step& step) {
  for (int v = region.v_begin; v < region.v_end;) {
    const int end = std::min(region.v_end, (v / rows + 1) * rows);
    Part columns;
    for (int row = v; row < end; row = (row / kAffectedRows_px + 1) * kAffectedRows_px) {
      columns = hull(columns, affected.columns_of(flags, region, row));
    }
    if (columns.begin < columns.end) step(words_of({columns.begin, columns.end, v, end}));
    v = end;
  }
}

}  // namespace

Part AffectedTiles::columns_of(const std::uint8_t* flags, const Region& region, int v) const {
  if (!flags) return {region.u_begin, region.u_end};
  const std::uint8_t* row = flags + static_cast<std::ptrdiff_t>(v / kAffectedRows_px) * columns;
  int first = region.u_begin / kTileWidth_px;
  int end = (region.u_end + kTileWidth_px - 1) / kTileWidth_px;
  while (first < end && !row[first]) ++first;
  while (first < end && !row[end - 1]) --end;
  return {first * kTileWidth_px, std::min(end * kTileWidth_px, region.u_end)};
}

void fetch_found(const SurfelWork& work, int v) {
  const Grid& grid = work.heights.grid;
  if (v >= grid.height) return;
  const FoundSurfel* row = work.found.get() + static_cast<std::ptrdiff_t>(v) * grid.width;
  const FoundSurfel* end = row + work.found_count[static_cast<std::size_t>(v)];
  const auto* at = reinterpret_cast<const std::byte*>(row);
  for (; at < reinterpret_cast<const std::byte*>(end); at += 64) hwy::Prefetch(at);
}

void prepare(const HeightMap& map, int threads, SurfelWork& work) {
  const Grid grid{map.intrinsics.width, map.intrinsics.height};
  work.heights.grid = grid;
  // A vector that starts in a row's last cell reads on.
  work.heights.height.assign(grid.size() + 64, 0);
  work.heights.variance.assign(grid.size() + 64, 0);
  work.heights.steady.assign(grid.tile(0, grid.height), 0);
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
  work.bands.resize(static_cast<std::size_t>(threads));
  for (BandWork& band : work.bands) {
    band.spread.resize(grid);
    band.affected.reserve(static_cast<std::size_t>(grid.height));
    band.row_found.assign(static_cast<std::size_t>(grid.words()), 0);
    band.searched.reserve(static_cast<std::size_t>(grid.stride() / kPiece_px));
    band.candidates.resize(static_cast<std::size_t>(grid.stride()));
    band.row_surfels.resize(static_cast<std::size_t>(grid.stride()));
    start_rings({0, grid.width}, band);
  }
  // Not set, so that memory is taken only where there are surfels.
  work.found = std::make_unique_for_overwrite<FoundSurfel[]>(map.rays.size());
  work.found_count.assign(static_cast<std::size_t>(grid.height), 0);
}

void find_in_regions(const SurfelRule& rule, const EdgeRule& edge_rule, std::span<const Region> regions,
                     const AffectedTiles& affected, const Part& wanted, SurfelWork& work, Workers& workers) {
  const auto each = [&](int beside_px, const auto& step) {
    // The first row that is searched is even.
    const Part all{std::max(0, wanted.begin / 2 * 2 - beside_px),
                   std::min(work.heights.grid.height, wanted.end + beside_px)};
    workers.run([&](int i) {
      const Part rows = band_of(regions, all, i, workers.count());
      for (Region region : regions) {
        region.v_begin = std::max(region.v_begin, rows.begin);
        region.v_end = std::min(region.v_end, rows.end);
        if (region.v_begin < region.v_end) step(region, work.bands[static_cast<std::size_t>(i)]);
      }
    });
  };
  each(kComparedBeside_px, [&](const Region& region, BandWork&) {
    in_parts(affected, affected.edges, kAffectedRows_px, region,
             [&](const WordArea& area) { compare_cells(work.heights, edge_rule, area, work.fits); });
  });
  each(kEdgesBeside_px, [&](const Region& region, BandWork&) {
    in_parts(affected, affected.edges, kAffectedRows_px, region,
             [&](const WordArea& area) { find_borders(work.heights, edge_rule, area, work.fits); });
  });
  each(kWindowsBeside_px, [&](const Region& region, BandWork& band) {
    in_parts(affected, affected.surfels, kWindowRows_px, region,
             [&](const WordArea& area) { fit_windows(area, work.fits, band.spread); });
  });
  each(0, [&](const Region& region, BandWork& band) { find_in_region(rule, region, affected, band, work); });
}

}  // namespace tubetrack
