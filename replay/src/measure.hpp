#pragma once

#include <cstdint>
#include <vector>

#include "tubetrack/replay/depth_noise.hpp"

namespace tubetrack {

/// What a sensor's pixels would be without a sensor's faults.
struct ExactPixels {
  int width = 0;
  int height = 0;
  std::vector<double> depth_m;        ///< at the pixels' centres: depth edges are found here
  std::vector<double> seen_depth_m;   ///< where each pixel really looks (lateral jitter); infinite: nothing
  std::vector<double> incidence_rad;  ///< there
  std::vector<unsigned char> shadow;  ///< there; empty: no shadow
};

/// What the sensor says: metres, 0 for no return; and the pixels that mix two surfaces.
struct MeasuredPixels {
  std::vector<double> depth_m;
  std::vector<unsigned char> mixed;
};

/// Axial noise, rounding, drop-out, mixed pixels and shadow of one frame. The jitter is the caller's: see pixel_jitter.
MeasuredPixels measure(const ExactPixels& exact, const DepthNoise& noise, std::uint64_t frame_seed);

/// A frame's own seed.
std::uint64_t seed_of_frame(std::uint64_t scene_seed, int frame);

/// How far from its centre a pixel looks, in pixels; |u|, |v| ≤ kMaxJitterSigmas · σ.
struct PixelJitter {
  double u_px = 0.0;
  double v_px = 0.0;
};
PixelJitter pixel_jitter(const DepthNoise& noise, std::uint64_t frame_seed, std::size_t pixel);
constexpr double kMaxJitterSigmas = 9.0;  ///< the normal deviates here never reach that

}  // namespace tubetrack
