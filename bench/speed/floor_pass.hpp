#pragma once

#include <cstdint>
#include <vector>

#include "tubetrack/heightmap/workers.hpp"
#include "tubetrack/sensors/depth_frame.hpp"

namespace tubetrack::bench {

/// Side of the floor pass's box: that of the smallest window of the surfels.
inline constexpr int kFloorBox_px = 7;

/// What the floor pass writes, and its working memory; row-major, of the size of the last frame.
struct FloorPass {
  std::vector<float> metres;  ///< the reading; 0 where there is none
  std::vector<float> mean_m;  ///< over the box around a pixel, as much of it as is in the image; no return counts as 0
  std::vector<std::int32_t> columns;  ///< for each thread: sums of each column over a box, in units of the frame
};

/// The least that anything which looks at all pixels does: one pass that converts a frame to metres and box-filters it.
/// Plain code, a band of rows for each of the workers; sums are of integers, so each mean is exact up to its last
/// rounding, with any number of them. Allocates only where the frame's size changed.
void floor_pass(const DepthFrame& frame, FloorPass& pass, Workers& workers);

}  // namespace tubetrack::bench
