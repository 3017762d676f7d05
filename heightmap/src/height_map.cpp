#include "tubetrack/heightmap/height_map.hpp"

#include <algorithm>
#include <span>

#include "fuse_row.hpp"

namespace tubetrack {

namespace {

/// Cells [u_begin, u_end) of a row are out of the region of interest: they hold nothing.
void clear_cells(HeightMap& map, int v, int u_begin, int u_end, TileChanges* tiles) {
  for (int u = u_begin; u < u_end; ++u) {
    const std::size_t at = map.cell(u, v);
    if (map.count[at] == 0) continue;
    map.depth_m[at] = 0.0F;
    map.inverse_depth_per_m[at] = 0.0F;
    map.count[at] = 0;
    TileChanges& tile = tiles[u / kTileWidth_px];
    ++tile.all;
    ++tile.steady;
  }
}

/// The tiles of a row of them that changed, from what their cells did.
void note_changes(HeightMap& map, int tile_row, bool all_new, std::span<const TileChanges> tiles) {
  const int rows = std::min(kTileHeight_px, map.intrinsics.height - tile_row * kTileHeight_px);
  for (std::size_t column = 0; column < tiles.size(); ++column) {
    const int columns = std::min(kTileWidth_px, map.intrinsics.width - static_cast<int>(column) * kTileWidth_px);
    const auto cells = static_cast<std::uint32_t>(rows * columns);
    const std::size_t at = static_cast<std::size_t>(tile_row) * tiles.size() + column;
    std::uint32_t& unsettled = map.tile_unsettled[at];
    unsettled += tiles[column].steady;
    const bool is_new = all_new || 4 * tiles[column].all >= cells;
    if (is_new) map.tile_new_in[at] = map.frame;
    const bool stirs = tiles[column].all > 0 && map.frame - map.tile_new_in[at] < kYoungFrames;
    if (!is_new && !stirs && 16 * unsettled < cells) continue;
    map.tile_changed_in[at] = map.frame;
    unsettled = 0;
  }
}

/// The pixels of the region of interest.
struct Roi {
  int u_begin, u_end, v_begin, v_end;

  Roi(const DepthFrame& frame, const HeightMapLimits& limits)
      : u_begin(0), u_end(frame.width), v_begin(0), v_end(frame.height) {
    if (limits.roi_width_px == 0 || limits.roi_height_px == 0) return;
    u_begin = std::clamp(limits.roi_u_px, 0, frame.width);
    v_begin = std::clamp(limits.roi_v_px, 0, frame.height);
    u_end = std::clamp(limits.roi_u_px + limits.roi_width_px, u_begin, frame.width);
    v_end = std::clamp(limits.roi_v_px + limits.roi_height_px, v_begin, frame.height);
  }
};

void update_row_of_tiles(HeightMap& map, const DepthFrame& frame, const FuseOptions& options, const Roi& roi,
                         int tile_row) {
  const auto columns = static_cast<std::size_t>(map.tile_columns());
  const std::span<TileChanges> tiles(map.tile_changes.data() + static_cast<std::size_t>(tile_row) * columns, columns);
  std::fill(tiles.begin(), tiles.end(), TileChanges{});
  const int v_end = std::min((tile_row + 1) * kTileHeight_px, frame.height);
  for (int v = tile_row * kTileHeight_px; v < v_end; ++v) {
    const bool inside = v >= roi.v_begin && v < roi.v_end;
    clear_cells(map, v, 0, inside ? roi.u_begin : frame.width, tiles.data());
    if (!inside) continue;
    clear_cells(map, v, roi.u_end, frame.width, tiles.data());
    const std::size_t at = map.cell(roi.u_begin, v);
    const CellRow row{frame.row(v) + roi.u_begin,      map.depth_m.data() + at, map.inverse_depth_per_m.data() + at,
                      map.variance_per_m2.data() + at, map.count.data() + at,   map.strikes.data() + at};
    fuse_row(options, row, roi.u_begin, roi.u_end - roi.u_begin, tiles.data());
  }
  note_changes(map, tile_row, !options.fuse, tiles);
}

}  // namespace

HeightMap make_height_map(const Intrinsics& intrinsics) {
  HeightMap map;
  map.intrinsics = intrinsics;
  map.rays = ray_table(intrinsics);
  map.depth_m.resize(map.rays.size());
  map.inverse_depth_per_m.resize(map.rays.size());
  map.variance_per_m2.resize(map.rays.size());
  map.count.resize(map.rays.size());
  map.strikes.resize(map.rays.size());
  const auto tiles = static_cast<std::size_t>(map.tile_columns()) * static_cast<std::size_t>(map.tile_rows());
  map.tile_changed_in.resize(tiles);
  map.tile_new_in.resize(tiles);
  map.tile_unsettled.resize(tiles);
  map.tile_changes.resize(tiles);
  return map;
}

void update(HeightMap& map, const DepthFrame& frame, const NoiseModel& noise, const HeightMapLimits& limits, bool fuse,
            Workers& workers) {
  const FuseOptions options{AxialNoise(noise), static_cast<float>(frame.metres_per_unit),
                            static_cast<float>(limits.depth_min_m), static_cast<float>(limits.depth_max_m), fuse};
  const Roi roi(frame, limits);
  map.unit_m = frame.metres_per_unit;
  ++map.frame;
  workers.run([&](int i) {
    const Part rows = part_of(map.tile_rows(), i, workers.count());
    for (int row = rows.begin; row < rows.end; ++row) update_row_of_tiles(map, frame, options, roi, row);
  });
}

void update(HeightMap& map, const DepthFrame& frame, const NoiseModel& noise, const HeightMapLimits& limits,
            bool fuse) {
  Workers alone(1);
  update(map, frame, noise, limits, fuse, alone);
}

}  // namespace tubetrack
