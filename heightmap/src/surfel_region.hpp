#pragma once

#include <array>
#include <memory>
#include <span>

#include "fit_windows.hpp"
#include "surfel_row.hpp"
#include "window_planes.hpp"
#include "window_sums.hpp"

namespace tubetrack {

/// A surfel is computed from heights up to here: half a window from planes that are half a window away.
inline constexpr int kSurfelReach_px = 2 * kLargestHalf_px;

/// Whether an odd row is searched depends on surfels of the row above up to so far beside.
inline constexpr int kBesidePiece_px = 8;

/// Buffers of one thread on the way from heights to surfels.
struct BandWork {
  SpreadWork spread;
  WindowSums sums;
  std::array<PlaneRing, kWindowSizes> planes;
  std::vector<Part> affected;            ///< by row of the region: columns whose surfels are found anew
  std::vector<std::uint64_t> row_found;  ///< of one row: columns with a surfel
  std::vector<Part> searched;            ///< of one row: columns that are searched
  std::vector<std::int32_t> candidates;  ///< of one row
  std::vector<FoundSurfel> row_surfels;  ///< and it, by column
};

/// What surfels are computed from and where they go.
struct SurfelWork {
  Heights heights;
  RayTable rays;
  float longest_ray2 = 0.0F;
  WindowFits fits;
  std::vector<BandWork> bands;           ///< one a thread
  std::unique_ptr<FoundSurfel[]> found;  ///< by row, room for one a column, in order of columns
  std::vector<int> found_count;          ///< by row
};

/// Pixels [u_begin, u_end) × [v_begin, v_end) of the image; u_begin is a multiple of 16, and u_end of 16 or the width.
struct Region {
  int u_begin = 0;
  int u_end = 0;
  int v_begin = 0;
  int v_end = 0;
};

/// Rows are affected by so many at once. (Columns by tiles: what is computed from them goes by vectors.)
inline constexpr int kAffectedRows_px = 8;

/// Where within regions something depends on heights that have changed: a flag for each kAffectedRows_px rows of each
/// column of tiles; none: all of it does.
struct AffectedTiles {
  const std::uint8_t* surfels = nullptr;
  const std::uint8_t* edges = nullptr;  ///< and which blocks are beside holes
  int columns = 0;                      ///< of tiles

  /// The columns of a region's row that have such a flag, and what is between them.
  Part columns_of(const std::uint8_t* flags, const Region& region, int v) const;
};

/// Fetches the surfels of a row, which lie far from those of others, so that the processor does not see them coming.
void fetch_found(const SurfelWork& work, int v);

void prepare(const HeightMap& map, int threads, SurfelWork& work);

/// The map's heights and variances of a region, in integer units.
void take_heights(const HeightMap& map, const Region& region, Heights& out);

/// Of a tile's cells that were steady when its heights were taken, how many have lost their reading since or are
/// another height by more than 5σ. What flickers is, most of the time, back where it was.
int count_moved(const HeightMap& map, const Region& tile, const Heights& taken);

/// Finds the surfels of some regions anew, in the wanted rows, where heights that they depend on have changed. Each
/// thread has a band of rows, so that all bands are about as much work; as sums are exact, what is found does not
/// depend on where they begin.
void find_in_regions(const SurfelRule& rule, const EdgeRule& edge_rule, std::span<const Region> regions,
                     const AffectedTiles& affected, const Part& wanted, SurfelWork& work, Workers& workers);

}  // namespace tubetrack
