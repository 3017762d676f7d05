#pragma once

#include "tubetrack/sensors/noise_model.hpp"

namespace tubetrack {

/// What a structured-light sensor does to the exact depth (DESIGN §5), in this order; each part can be switched off.
struct DepthNoise {
  bool axial = true;               ///< Gaussian along z, σ of the sensor's model at the incidence, at most that of 85°
  bool jitter = true;              ///< the pixel looks σ = sensor.lateral_px beside its centre, in u and in v
  bool quantisation = true;        ///< disparity rounded to sensor.disparity_step_px
  bool dropout = true;             ///< no return above 80° incidence, nor from half of the pixels at a depth edge
  bool mixed = true;               ///< 30 % of the edge pixels that are left lie between the two depths
  bool shadow = true;              ///< no return where the projector, 75 mm to the camera's right, does not shine
  double metres_per_unit = 0.001;  ///< of the 16-bit depth; rounding to it is always on
  NoiseModel sensor{.name = "synthetic", .radius_relative = 0.0};

  /// Every part off, and 0.1 mm units so that the 16-bit rounding does not dominate (range 6.5 m).
  static DepthNoise none();
};

}  // namespace tubetrack
