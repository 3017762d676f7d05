#include "tubetrack/sensors/noise_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tubetrack {

Expected<NoiseModel> noise_model_by_name(std::string_view name) {
  NoiseModel model;
  model.name = name;
  if (name == "kinect1") return model;
  if (name == "stereo") {  // active stereo at 1280×720 scale: the disparity error dominates
    model.axial_constant_m = 0.0006;
    model.axial_quadratic_per_m = 0.0030;
    model.axial_reference_m = 0.2;
    model.disparity_step_px = 0.03125;
    model.baseline_focal_m_px = 34.0;
    return model;
  }
  if (name == "tof") {
    model.axial_constant_m = 0.0020;
    model.axial_quadratic_per_m = 0.0004;
    model.axial_reference_m = 0.5;
    model.disparity_step_px = 0.0;
    return model;
  }
  return tl::make_unexpected(
      Error::usage(fmt::format("--noise: got '{}', takes kinect1, stereo, tof or a JSON file", name)));
}

double axial_sigma_m(const NoiseModel& m, double depth_m, double incidence_rad) {
  const double theta = std::clamp(incidence_rad, 0.0, 85.0 * std::numbers::pi / 180.0);
  const double off = depth_m - m.axial_reference_m;
  const double left = std::numbers::pi / 2.0 - theta;
  const double gauss = m.axial_constant_m + m.axial_quadratic_per_m * off * off +
                       m.axial_grazing / std::sqrt(std::max(depth_m, 1e-3)) * theta * theta / (left * left);
  // A rounded value is uniform over its step, whose σ is step / √12.
  const double step = depth_m * depth_m / m.baseline_focal_m_px * m.disparity_step_px;
  return std::sqrt(gauss * gauss + step * step / 12.0);
}

double depth_sigma_m(const NoiseModel& m, double depth_m, double incidence_rad, double focal_px) {
  const double theta = std::clamp(incidence_rad, 0.0, 85.0 * std::numbers::pi / 180.0);
  const double axial = axial_sigma_m(m, depth_m, theta);
  const double lateral = m.lateral_px * depth_m / focal_px * std::tan(theta);
  return std::sqrt(axial * axial + lateral * lateral);
}

double depth_of_level_m(const NoiseModel& m, double depth_m) {
  if (m.disparity_step_px <= 0.0 || depth_m <= 0.0) return depth_m;
  const double per_level = m.baseline_focal_m_px / m.disparity_step_px;
  return per_level / std::max(1.0, std::round(per_level / depth_m));
}

}  // namespace tubetrack
