#pragma once

#include <optional>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/sensors/noise_model.hpp"

namespace tubetrack {

/// Every setting of the tracker; the defaults here are the only ones. Keys of the JSON config have the same names.
struct TrackerConfig {
  double radius_min_m = 0.005;
  double radius_max_m = 0.100;
  std::optional<double> radius_m;  ///< known radius: held, not fitted
  bool varying_radius = false;     ///< the radius may vary along a tube, as a hose's or a branch's does
  double depth_min_m = 0.15;
  double depth_max_m = 10.0;
  int roi_u_px = 0;  ///< region of interest; width or height 0: the whole image
  int roi_v_px = 0;
  int roi_width_px = 0;
  int roi_height_px = 0;
  double min_length_radii = 1.5;  ///< a shorter tube is not reported
  double min_length_m = 0.020;    ///< nor one shorter than this
  double min_width_px = 8.0;      ///< nor one narrower in the image
  double min_bend_radii = 4.0;    ///< nor one whose centreline bends tighter than this many tube radii
  std::optional<double> cell_m;   ///< grid step of the accumulation map; empty: matched to the sensor, about two pixels
  int threads = 1;                ///< that share the work on a frame, 1 to 16; results do not depend on it
  /// From the call on: when it passes, known tubes are followed still, new ones are left to the next frame, and the
  /// status says `deadline`. Empty: none; only then are results the same in every run.
  std::optional<double> deadline_ms;
  NoiseModel noise;
};

/// Names the first field out of its range, what it got and what it takes.
Expected<void> validate(const TrackerConfig& config);

}  // namespace tubetrack
