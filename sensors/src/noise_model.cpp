#include "tubetrack/sensors/noise_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tubetrack {

namespace {

/// Which sensor a device is, by what its driver calls it. "Microsoft Kinect" is not here: drivers say it of the first
/// Kinect (structured light) and of the second (time of flight) alike.
struct KnownDevice {
  std::string_view part_of_name;  ///< in lower case
  std::string_view model;
};
constexpr KnownDevice kKnownDevices[] = {
    {"primesense", "kinect1"}, {"asus xtion", "kinect1"}, {"orbbec astra", "kinect1"}, {"realsense d4", "stereo"}};

struct FieldRange {
  const char* name;
  double NoiseModel::* field;
  double low, high;
  const char* takes;
};
constexpr FieldRange kRanges[] = {
    {"axial_constant_m", &NoiseModel::axial_constant_m, 0.0, 1.0, "metres, 0 to 1"},
    {"axial_quadratic_per_m", &NoiseModel::axial_quadratic_per_m, 0.0, 1.0, "1/metres, 0 to 1"},
    {"axial_reference_m", &NoiseModel::axial_reference_m, 0.0, 100.0, "metres, 0 to 100"},
    {"axial_grazing", &NoiseModel::axial_grazing, 0.0, 1.0, "0 to 1"},
    {"lateral_px", &NoiseModel::lateral_px, 0.0, 100.0, "pixels, 0 to 100"},
    {"disparity_step_px", &NoiseModel::disparity_step_px, 0.0, 100.0, "pixels, 0 to 100"},
    {"baseline_focal_m_px", &NoiseModel::baseline_focal_m_px, 1e-3, 1e5, "metres × pixels, 0.001 to 100000"},
    {"depth_step_m", &NoiseModel::depth_step_m, 0.0, 1.0, "metres, 0 to 1"},
    {"radius_relative", &NoiseModel::radius_relative, 0.0, 0.5, "part of the radius, 0 to 0.5"}};

bool contains_lower_case(std::string_view text, std::string_view part) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  return std::search(text.begin(), text.end(), part.begin(), part.end(),
                     [&](char a, char b) { return lower(a) == b; }) != text.end();
}

}  // namespace

Expected<void> validate(const NoiseModel& model) {
  for (const FieldRange& range : kRanges) {
    const double value = model.*range.field;
    if (std::isfinite(value) && value >= range.low && value <= range.high) continue;
    return tl::make_unexpected(Error::usage(fmt::format("{}: got {:g}, takes {}", range.name, value, range.takes)));
  }
  // Fits divide by σ; a reading that can't be wrong has no weight.
  if (model.axial_constant_m == 0.0 && model.disparity_step_px == 0.0 && model.depth_step_m == 0.0) {
    return tl::make_unexpected(Error::usage(
        "axial_constant_m: got 0, takes more than 0 metres where disparity_step_px and depth_step_m are 0 too"));
  }
  return {};
}

const std::vector<NoiseModel>& built_in_noise_models() {
  static const std::vector<NoiseModel> models = {{.name = "kinect1"},
                                                 // Active stereo at 1280×720 scale: the disparity error dominates.
                                                 {.name = "stereo",
                                                  .axial_constant_m = 0.0006,
                                                  .axial_quadratic_per_m = 0.0030,
                                                  .axial_reference_m = 0.2,
                                                  .disparity_step_px = 0.03125,
                                                  .baseline_focal_m_px = 34.0},
                                                 {.name = "tof",
                                                  .axial_constant_m = 0.0020,
                                                  .axial_quadratic_per_m = 0.0004,
                                                  .axial_reference_m = 0.5,
                                                  .disparity_step_px = 0.0},
                                                 {.name = "synthetic", .radius_relative = 0.0}};
  return models;
}

Expected<NoiseModel> noise_model_by_name(std::string_view name) {
  for (const NoiseModel& model : built_in_noise_models()) {
    if (model.name == name) return model;
  }
  return tl::make_unexpected(
      Error::usage(fmt::format("--noise: got '{}', takes kinect1, stereo, tof, synthetic or a JSON file", name)));
}

std::optional<NoiseModel> noise_model_of_device(std::string_view device) {
  for (const KnownDevice& known : kKnownDevices) {
    if (!contains_lower_case(device, known.part_of_name)) continue;
    if (auto model = noise_model_by_name(known.model)) return *model;
  }
  return {};
}

double axial_sigma_m(const NoiseModel& m, double depth_m, double incidence_rad) {
  const double theta = std::clamp(incidence_rad, 0.0, 85.0 * std::numbers::pi / 180.0);
  const double off = depth_m - m.axial_reference_m;
  const double left = std::numbers::pi / 2.0 - theta;
  const double gauss = m.axial_constant_m + m.axial_quadratic_per_m * off * off +
                       m.axial_grazing / std::sqrt(std::max(depth_m, 1e-3)) * theta * theta / (left * left);
  // A rounded value is uniform over its step, whose σ is step / √12.
  const double step = depth_m * depth_m / m.baseline_focal_m_px * m.disparity_step_px;
  return std::sqrt(gauss * gauss + (step * step + m.depth_step_m * m.depth_step_m) / 12.0);
}

double depth_sigma_m(const NoiseModel& m, double depth_m, double incidence_rad, double focal_px) {
  const double theta = std::clamp(incidence_rad, 0.0, 85.0 * std::numbers::pi / 180.0);
  const double axial = axial_sigma_m(m, depth_m, theta);
  const double lateral = m.lateral_px * depth_m / focal_px * std::tan(theta);
  return std::sqrt(axial * axial + lateral * lateral);
}

}  // namespace tubetrack
