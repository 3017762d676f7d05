#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "tubetrack/heightmap/workers.hpp"
#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/disparity_levels.hpp"
#include "tubetrack/sensors/intrinsics.hpp"
#include "tubetrack/sensors/noise_model.hpp"

namespace tubetrack {

/// Changes are noted by tiles of this size, the first at pixel (0, 0).
inline constexpr int kTileWidth_px = 16;
inline constexpr int kTileHeight_px = 16;

/// Cells of a tile that restarted, or gained or lost their reading, in one frame; and how many of them had been steady.
struct TileChanges {
  std::uint32_t all = 0;
  std::uint32_t steady = 0;
};

/// The image grid of DESIGN §2: a cell is a depth pixel, its height is inverse depth. All buffers are row-major with
/// width × height cells. A plane in space is a plane in (ray x, ray y, inverse depth), so heights can be averaged and
/// fitted linearly.
struct HeightMap {
  Intrinsics intrinsics;
  std::vector<Eigen::Vector2f> rays;       ///< (x/z, y/z) of the cell's ray
  std::vector<float> depth_m;              ///< this frame's own reading; 0: none
  std::vector<float> inverse_depth_per_m;  ///< over the frames that agreed; 0: none
  std::vector<float> variance_per_m2;      ///< of inverse_depth_per_m
  std::vector<std::uint8_t> count;         ///< frames in the cell
  std::vector<std::uint8_t> strikes;       ///< frames running that disagreed by more than 3σ
  std::uint32_t frame = 0;                 ///< counts the updates
  /// By tile, row-major: the frame in which it last changed. A cell changes where it restarts or gains or loses its
  /// reading, not where it is refined; at silhouettes some do in every frame. A tile is new when a quarter of its cells
  /// change at once. It changes then, with any cell in the seven frames after, and later when, since it last did, a
  /// sixteenth of its cells have that had been steady (eight frames agreed in them).
  std::vector<std::uint32_t> tile_changed_in;
  std::vector<std::uint32_t> tile_new_in;     ///< by tile: the frame in which it was last new
  std::vector<std::uint32_t> tile_unsettled;  ///< by tile: steady cells that changed since it did
  std::vector<TileChanges> tile_changes;      ///< by tile, of this frame

  int tile_columns() const { return (intrinsics.width + kTileWidth_px - 1) / kTileWidth_px; }
  int tile_rows() const { return (intrinsics.height + kTileHeight_px - 1) / kTileHeight_px; }
  bool at_disparity_levels = false;  ///< see `lies_at_disparity_levels`; set by whoever asked
  double unit_m = 0.0;               ///< of the last frame's readings

  std::size_t cell(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(intrinsics.width) + static_cast<std::size_t>(u);
  }
  /// The frame's own point of a cell, metres in the camera frame; only where depth_m > 0.
  Eigen::Vector3d point(std::size_t at) const {
    const double z = depth_m[at];
    return {rays[at].x() * z, rays[at].y() * z, z};
  }
};

/// What of a frame enters the map; a region with width or height 0 is the whole image.
struct HeightMapLimits {
  double depth_min_m = 0.15;
  double depth_max_m = 10.0;
  int roi_u_px = 0;
  int roi_v_px = 0;
  int roi_width_px = 0;
  int roi_height_px = 0;
};

HeightMap make_height_map(const Intrinsics& intrinsics);

/// Takes a frame in. A reading within 3σ of its cell refines it; one beyond 5σ, or beyond 3σ twice running, restarts
/// it. With a moving camera the cells look elsewhere in every frame: `fuse` false restarts all of them.
/// The frame must have the map's size. The result does not depend on the workers.
void update(HeightMap& map, const DepthFrame& frame, const NoiseModel& noise, const HeightMapLimits& limits, bool fuse,
            Workers& workers);
void update(HeightMap& map, const DepthFrame& frame, const NoiseModel& noise, const HeightMapLimits& limits, bool fuse);

/// Are the frame's readings those of the noise model's disparity levels, rounded to the recording's unit? Asked of a
/// few thousand readings where levels lie farther apart than units; empty where there are too few to tell.
std::optional<bool> lies_at_disparity_levels(const DepthFrame& frame, const NoiseModel& noise);

/// The disparity levels that the map's readings come from; none where they lie at none.
inline DisparityLevels levels_of_readings(const HeightMap& map, const NoiseModel& noise) {
  return map.at_disparity_levels ? disparity_levels(noise, map.unit_m) : DisparityLevels{};
}

}  // namespace tubetrack
