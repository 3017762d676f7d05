#include "tubetrack/heightmap/height_map.hpp"

#include <algorithm>
#include <cmath>

namespace tubetrack {

namespace {

constexpr std::uint8_t kMaxCount = 30;

/// Fuses one reading (inverse depth and its variance) into a cell, or restarts the cell with it.
void fuse_reading(HeightMap& map, std::size_t at, float height, float variance, bool fuse) {
  const auto restart = [&] {
    map.inverse_depth_per_m[at] = height;
    map.variance_per_m2[at] = variance;
    map.count[at] = 1;
    map.strikes[at] = 0;
  };
  if (!fuse || map.count[at] == 0) return restart();
  const float moved = height - map.inverse_depth_per_m[at];
  const float expected = variance + map.variance_per_m2[at];
  if (moved * moved > 25.0F * expected) return restart();
  if (moved * moved > 9.0F * expected) {
    if (++map.strikes[at] >= 2) restart();
    return;
  }
  map.strikes[at] = 0;
  map.count[at] = static_cast<std::uint8_t>(std::min<int>(map.count[at] + 1, kMaxCount));
  const float n = static_cast<float>(map.count[at]);
  map.inverse_depth_per_m[at] += moved / n;
  map.variance_per_m2[at] = variance / n;
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
  return map;
}

void update(HeightMap& map, const DepthFrame& frame, const NoiseModel& noise, const HeightMapLimits& limits,
            bool fuse) {
  const bool whole = limits.roi_width_px == 0 || limits.roi_height_px == 0;
  const int u_begin = whole ? 0 : limits.roi_u_px;
  const int v_begin = whole ? 0 : limits.roi_v_px;
  const int u_end = whole ? frame.width : limits.roi_u_px + limits.roi_width_px;
  const int v_end = whole ? frame.height : limits.roi_v_px + limits.roi_height_px;
  const float scale = static_cast<float>(frame.metres_per_unit);
  // The noise depends on depth alone here (the incidence is not known yet): one look-up a millimetre.
  const int steps = 1 + static_cast<int>(std::min(limits.depth_max_m, 30.0) * 1000.0);
  std::vector<float> sigma(static_cast<std::size_t>(steps) + 1);
  for (int i = 0; i <= steps; ++i) {
    sigma[static_cast<std::size_t>(i)] = static_cast<float>(axial_sigma_m(noise, std::max(i, 1) * 0.001, 0.0));
  }
  for (int v = 0; v < frame.height; ++v) {
    const std::uint16_t* row = frame.row(v);
    const bool row_in = v >= v_begin && v < v_end;
    for (int u = 0; u < frame.width; ++u) {
      const std::size_t at = map.cell(u, v);
      const float z = static_cast<float>(row[u]) * scale;
      const bool usable =
          row_in && u >= u_begin && u < u_end && row[u] != 0 && z >= limits.depth_min_m && z <= limits.depth_max_m;
      map.depth_m[at] = usable ? z : 0.0F;
      if (!usable) {
        map.inverse_depth_per_m[at] = 0.0F;
        map.count[at] = 0;
        continue;
      }
      const float s = sigma[static_cast<std::size_t>(std::min(static_cast<int>(z * 1000.0F), steps))] / (z * z);
      fuse_reading(map, at, 1.0F / z, s * s, fuse);
    }
  }
}

}  // namespace tubetrack
