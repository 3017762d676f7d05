#pragma once

#include <cstdint>

#include "axial_noise.hpp"
#include "tubetrack/heightmap/height_map.hpp"

namespace tubetrack {

struct FuseOptions {
  AxialNoise noise;
  float metres_per_unit = 0.001F;
  float depth_min_m = 0.0F;
  float depth_max_m = 0.0F;
  bool fuse = true;  ///< false: every cell restarts
};

/// Cells of one row, from the first one on, and the readings that they take.
struct CellRow {
  const std::uint16_t* pixels = nullptr;
  float* depth_m = nullptr;
  float* inverse_depth_per_m = nullptr;
  float* variance_per_m2 = nullptr;
  std::uint8_t* count = nullptr;
  std::uint8_t* strikes = nullptr;
};

/// A cell is steady once this many frames agree in it. At a silhouette, where readings come and go, few ever are.
inline constexpr int kSteadyCount = 8;
/// So long after a tile was new every change counts: what came with it is still to be found.
inline constexpr std::uint32_t kYoungFrames = 8;

/// Takes one reading into each of `cells` cells. Where they change, the counts of their columns of tiles go up (not
/// with `fuse` false, where all do); the row's first cell is in column `u_first` of the image.
void fuse_row(const FuseOptions& options, const CellRow& row, int u_first, int cells, TileChanges* tiles);

}  // namespace tubetrack
