#include "tubetrack/heightmap/height_map.hpp"

#include <algorithm>

#include "fuse_row.hpp"

namespace tubetrack {

namespace {

/// Cells [u_begin, u_end) of a row are out of the region of interest: they hold nothing.
void clear_cells(HeightMap& map, int v, int u_begin, int u_end) {
  for (int u = u_begin; u < u_end; ++u) {
    const std::size_t at = map.cell(u, v);
    if (map.count[at] == 0) continue;
    map.depth_m[at] = 0.0F;
    map.inverse_depth_per_m[at] = 0.0F;
    map.count[at] = 0;
    map.tile_changed_in[static_cast<std::size_t>(v / kTileHeight_px) * static_cast<std::size_t>(map.tile_columns()) +
                        static_cast<std::size_t>(u / kTileWidth_px)] = map.frame;
  }
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
  map.tile_changed_in.resize(static_cast<std::size_t>(map.tile_columns()) * static_cast<std::size_t>(map.tile_rows()));
  return map;
}

void update(HeightMap& map, const DepthFrame& frame, const NoiseModel& noise, const HeightMapLimits& limits,
            bool fuse) {
  const bool whole = limits.roi_width_px == 0 || limits.roi_height_px == 0;
  const int u_begin = whole ? 0 : std::clamp(limits.roi_u_px, 0, frame.width);
  const int v_begin = whole ? 0 : std::clamp(limits.roi_v_px, 0, frame.height);
  const int u_end = whole ? frame.width : std::clamp(limits.roi_u_px + limits.roi_width_px, u_begin, frame.width);
  const int v_end = whole ? frame.height : std::clamp(limits.roi_v_px + limits.roi_height_px, v_begin, frame.height);
  const FuseOptions options{AxialNoise(noise), static_cast<float>(frame.metres_per_unit),
                            static_cast<float>(limits.depth_min_m), static_cast<float>(limits.depth_max_m), fuse};
  ++map.frame;
  for (int v = 0; v < frame.height; ++v) {
    if (v < v_begin || v >= v_end) {
      clear_cells(map, v, 0, frame.width);
      continue;
    }
    clear_cells(map, v, 0, u_begin);
    clear_cells(map, v, u_end, frame.width);
    const std::size_t at = map.cell(u_begin, v);
    const CellRow row{frame.row(v) + u_begin,          map.depth_m.data() + at, map.inverse_depth_per_m.data() + at,
                      map.variance_per_m2.data() + at, map.count.data() + at,   map.strikes.data() + at};
    fuse_row(options, row, u_begin, u_end - u_begin, map.frame,
             map.tile_changed_in.data() + static_cast<std::ptrdiff_t>(v / kTileHeight_px) * map.tile_columns());
  }
}

}  // namespace tubetrack
