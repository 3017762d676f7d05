#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// How far a depth sensor's reading strays from the truth, as data.
/// σ_z = constant + quadratic (z − reference)² + grazing/√z · θ²/(π/2 − θ)²   (metres; θ the incidence, ≤ 85°),
/// plus the lateral jitter σ_lateral z/f tan θ, plus the rounding of the disparity and of the depth (docs/noise.md).
struct NoiseModel {
  std::string name = "kinect1";
  double axial_constant_m = 0.0012;
  double axial_quadratic_per_m = 0.0019;
  double axial_reference_m = 0.4;
  double axial_grazing = 0.0001;  ///< m·√m
  double lateral_px = 0.5;
  double disparity_step_px = 0.125;    ///< 0: the sensor does not measure disparity
  double baseline_focal_m_px = 42.75;  ///< baseline × focal length: 0.075 m × 570 px
  double depth_step_m = 0.0;           ///< depths are multiples of this; 0: finer than all the rest
  /// How far radii seen by such a sensor are off alike, σ as part of the radius: it smooths, and its scale is known
  /// only so well. No average takes it out, so it is added to the uncertainty that is reported.
  double radius_relative = 0.025;
};

/// Names the first field that cannot be right, what it got and what it takes.
Expected<void> validate(const NoiseModel& model);

/// kinect1, stereo, tof, and synthetic: kinect1 without errors that are common to all frames.
const std::vector<NoiseModel>& built_in_noise_models();

/// One of the built-in models. Unknown names list the known ones.
Expected<NoiseModel> noise_model_by_name(std::string_view name);

/// The model for a live device, by "maker name" as its driver says it ("PrimeSense PS1080"); empty: not a known one.
std::optional<NoiseModel> noise_model_of_device(std::string_view device);

/// σ of one depth reading along its ray's z (metres): axial and rounding parts, without lateral jitter.
double axial_sigma_m(const NoiseModel& model, double depth_m, double incidence_rad);

/// σ of one depth reading with the lateral jitter included (DESIGN §2, Fit).
double depth_sigma_m(const NoiseModel& model, double depth_m, double incidence_rad, double focal_px);

}  // namespace tubetrack
