#include "tubetrack/replay/noise_calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace tubetrack {

namespace {

constexpr std::int64_t kMinFrames = 10;
constexpr double kMaxChanged = 0.10;
constexpr double kMaxComingAndGoing = 0.50;  ///< dark and shiny surfaces do; so does everything when the camera moves
constexpr std::int64_t kMinSamples = 1000;

tl::unexpected<Error> refuse(std::string message) {
  return tl::make_unexpected(Error::failed(std::move(message)));
}

Expected<void> check_stillness(const StillScene& scene, std::int64_t frames) {
  const auto seen = static_cast<double>(scene.seen_pixels);
  const auto judged = static_cast<double>(scene.judged_pixels);
  const auto changed = static_cast<double>(scene.changed_pixels);
  constexpr const char* kWanted = "a still scene and a camera at rest; --frames A:B picks a part";
  if (judged < (1.0 - kMaxComingAndGoing) * seen) {
    return refuse(
        fmt::format("{:.0f} % of the pixels have a depth in some of the {} frames only, takes at most {:.0f} %: {}",
                    100.0 * (1.0 - judged / seen), frames, 100.0 * kMaxComingAndGoing, kWanted));
  }
  if (changed > kMaxChanged * judged) {
    return refuse(
        fmt::format("{:.0f} % of the pixels changed by more than noise in {} frames, takes at most {:.0f} %: {}",
                    100.0 * changed / judged, frames, 100.0 * kMaxChanged, kWanted));
  }
  if (scene.samples.size() < kMinSamples) {
    return refuse(fmt::format("only {} pixels lie on smooth surfaces, takes {}: point the camera at walls and boxes",
                              scene.samples.size(), kMinSamples));
  }
  return {};
}

std::vector<NoiseTableRow> table(std::span<const NoiseBin> bins, const NoiseModel& model) {
  std::map<int, NoiseTableRow> rows;
  for (const NoiseBin& bin : bins) {
    // Edges as in noise_bins, two of its bins a row.
    const int key = static_cast<int>(std::floor(std::floor(std::log(bin.depth_m) / std::log(1.05)) / 2.0));
    NoiseTableRow& row = rows[key];
    row.depth_from_m = std::pow(1.05, 2 * key);
    row.depth_to_m = std::pow(1.05, 2 * key + 2);
    const auto pixels = static_cast<double>(bin.pixels);
    const double axial_m = axial_sigma_m(model, bin.depth_m, bin.incidence_rad);
    row.pixels += bin.pixels;
    row.measured_m += pixels * bin.variance_m2;
    row.model_m += pixels * (axial_m * axial_m + model.lateral_px * model.lateral_px * bin.slope2_m2_per_px2);
  }
  std::vector<NoiseTableRow> out;
  for (auto& [key, row] : rows) {
    row.measured_m = std::sqrt(row.measured_m / static_cast<double>(row.pixels));
    row.model_m = std::sqrt(row.model_m / static_cast<double>(row.pixels));
    out.push_back(row);
  }
  return out;
}

std::vector<std::string> notes_on(const StillScene& scene, const RoundingSteps& steps, const NoiseFit& fit,
                                  const NoiseModel& start) {
  std::vector<std::string> notes;
  if (scene.changed_pixels > 0) {
    notes.push_back(
        fmt::format("{:.1f} % of the pixels changed by more than noise and are left out",
                    100.0 * static_cast<double>(scene.changed_pixels) / static_cast<double>(scene.judged_pixels)));
  }
  constexpr std::array<const char*, kNoiseTerms.size()> kLacking{
      "", "too little spread of depth", "too little spread of depth, or no growth of noise with it",
      "too few grazing surfaces", "too few slanted surfaces"};
  for (std::size_t i = 0; i < kNoiseTerms.size(); ++i) {
    if (fit.fitted[i]) continue;
    notes.push_back(fmt::format("{} cannot be told from this recording ({}); it is that of {}", kNoiseTerms[i],
                                kLacking[i], start.name));
  }
  if (steps.disparity == RoundingSteps::Disparity::unknown) {
    notes.push_back(fmt::format(
        "disparity_step_px cannot be told from this recording (too few depths, or too near); it is that of {}",
        start.name));
  }
  if (scene.correlation > 0.2) {
    notes.push_back(fmt::format(
        "a reading's error goes on into the next frame (correlation {:.2f}): the scene drifts, or the sensor averages "
        "over time, and then its frames are less sure than their scatter",
        scene.correlation));
  }
  return notes;
}

}  // namespace

Expected<NoiseCalibration> calibrate_noise(const PixelHistory& history, const Intrinsics& intrinsics,
                                           const NoiseModel& start) {
  if (history.frames < kMinFrames) {
    return refuse(fmt::format("{} good frame(s), takes at least {}", history.frames, kMinFrames));
  }
  const RoundingSteps steps = rounding_steps(history, start);
  const StillScene scene = still_scene(history, intrinsics, steps);
  if (auto still = check_stillness(scene, history.frames); !still) return tl::make_unexpected(still.error());
  const std::vector<NoiseBin> bins = noise_bins(scene.samples, steps);
  if (bins.empty()) return refuse("too few pixels of like depth and incidence: point the camera at walls and boxes");
  const NoiseFit fit = fit_noise_model(bins, history.frames, steps, start);
  NoiseCalibration out;
  out.model = fit.model;
  out.model.depth_step_m = steps.depth_m;
  out.model.disparity_step_px = steps.inverse_depth_per_m * start.baseline_focal_m_px;
  out.notes = notes_on(scene, steps, fit, start);
  out.rows = table(bins, out.model);
  return out;
}

}  // namespace tubetrack
