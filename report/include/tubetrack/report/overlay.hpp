#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/intrinsics.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// Writes a colour PNG: the depth image in grey, near is bright, with each tube's centreline and both silhouettes drawn
/// on it (hidden parts dashed and paler), its id and its radius in millimetres. Tubes in the world frame are brought
/// back with frame.world_from_camera. The folder must exist.
Expected<void> write_overlay(const std::filesystem::path& path, const DepthFrame& frame, const Intrinsics& intrinsics,
                             const TubeFrame& result);

/// Eight bits each of blue, green and red a pixel, row after row.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> bgr;
};

/// The same for a window: depth in false colours, near is red and far is blue; the line below has the latency as well.
Picture draw_view(const DepthFrame& frame, const Intrinsics& intrinsics, const TubeFrame& result);

}  // namespace tubetrack
