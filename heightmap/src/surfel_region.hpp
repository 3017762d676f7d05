#pragma once

#include <array>
#include <memory>

#include "edges.hpp"
#include "surfel_row.hpp"
#include "window_planes.hpp"
#include "window_sums.hpp"

namespace tubetrack {

inline constexpr std::size_t kWindowSizes = kWindowHalfSizes_px.size();
/// A surfel depends on heights up to here: half a window from planes that are half a window away.
inline constexpr int kSurfelReach_px = 2 * kWindowHalfSizes_px.back();

struct Windows {
  BitImage fits;   ///< the window around the cell stays on one side of edges and within the image
  BitImage holes;  ///< a cell of the window has no height
};

/// What surfels are computed from and where they go; and the buffers on the way.
struct SurfelWork {
  Heights heights;
  RayTable rays;
  float longest_ray2 = 0.0F;
  Edges edges;
  BitImage missing;
  BitImage spread;
  std::array<Windows, kWindowSizes> windows;
  /// By row and block of kSumBlock_px columns, from padded column 0: a hole in the block or the one beside it, and
  /// such a hole in any row that a window shares with this one.
  std::vector<std::uint8_t> beside_holes;
  std::vector<std::uint8_t> near_holes;
  WindowSums sums;
  std::array<PlaneRing, kWindowSizes> planes;
  std::vector<std::uint64_t> row_found;  ///< of one row: columns with a surfel
  std::vector<FoundSurfel> row_surfels;  ///< and it, by column
  std::unique_ptr<FoundSurfel[]> found;  ///< by row, room for one a column, in order of columns
  std::vector<int> found_count;          ///< by row
};

/// Pixels [u_begin, u_end) × [v_begin, v_end); the columns are multiples of 32.
struct Region {
  int u_begin = 0;
  int u_end = 0;
  int v_begin = 0;
  int v_end = 0;
};

void prepare(const HeightMap& map, SurfelWork& work);

/// The map's heights and variances in integer units, columns [u_begin, u_end) of row v.
void take_heights(const HeightMap& map, int v, int u_begin, int u_end, Heights& out);

/// Where windows fit and have holes, in rows [v_begin, v_end), from the heights.
void fit_windows(const EdgeRule& rule, int v_begin, int v_end, SurfelWork& work);

/// Finds the surfels of a region anew, from the heights and `fit_windows` of everything within reach.
void find_in_region(const SurfelRule& rule, const Region& region, SurfelWork& work);

}  // namespace tubetrack
