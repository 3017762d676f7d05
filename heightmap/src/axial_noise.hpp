#pragma once

#include "tubetrack/sensors/noise_model.hpp"

namespace tubetrack {

/// `axial_sigma_m` straight ahead (incidence 0), as the polynomials the per-pixel loops evaluate. With w the inverse
/// depth, σ_w² = (constant w² + quadratic (1 − reference w)²)² + rounding_variance.
struct AxialNoise {
  float constant_m = 0.0F;
  float quadratic_per_m = 0.0F;
  float reference_m = 0.0F;
  float rounding_variance_per_m2 = 0.0F;  ///< of the disparity step; in inverse depth the same at every depth

  explicit AxialNoise(const NoiseModel& model)
      : constant_m(static_cast<float>(model.axial_constant_m)),
        quadratic_per_m(static_cast<float>(model.axial_quadratic_per_m)),
        reference_m(static_cast<float>(model.axial_reference_m)),
        rounding_variance_per_m2(static_cast<float>(model.disparity_step_px * model.disparity_step_px /
                                                    (12.0 * model.baseline_focal_m_px * model.baseline_focal_m_px))) {}
  bool operator==(const AxialNoise&) const = default;
};

}  // namespace tubetrack
