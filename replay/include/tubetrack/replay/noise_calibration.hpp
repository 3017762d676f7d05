#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/intrinsics.hpp"
#include "tubetrack/sensors/noise_model.hpp"

namespace tubetrack {

// A sensor's noise model from a still scene (docs/noise.md): what each pixel did over time → the steps its depths are
// rounded to → samples (depth, incidence, variance) → bins → the model. Each arrow is one of the functions below.

/// What one pixel saw, in raw counts: exact integer sums, so that the order of frames' parts does not matter.
struct PixelSums {
  std::uint32_t returns = 0;
  std::uint16_t last = 0;
  std::uint64_t sum = 0;
  std::uint64_t sum_of_squares = 0;
  std::uint64_t squared_changes = 0;  ///< Σ of the squared change from one return to the next
};

/// What all pixels of a recording saw.
struct PixelHistory {
  int width = 0;
  int height = 0;
  double metres_per_unit = 0.001;
  std::int64_t frames = 0;
  std::vector<PixelSums> pixels;      ///< row-major
  std::vector<std::uint64_t> levels;  ///< how often each raw count occurred, 0 to 65535
};

/// The first frame sets size and unit; frames of another size are an error.
Expected<void> add_frame(PixelHistory& history, const DepthFrame& frame);

/// What depths are rounded to. A step of disparity is one of inverse depth: only its quotient by baseline × focal
/// length can be seen in depths.
struct RoundingSteps {
  double depth_m = 0.0;
  double inverse_depth_per_m = 0.0;
  enum class Disparity { seen, none, unknown };
  /// `none`: depths lie closer than the expected step would let them. `unknown`: too near or too few to tell.
  Disparity disparity = Disparity::unknown;

  double at(double depth_m) const;  ///< both together, in metres of depth
};

/// From the raw counts that occur and those that are missing between them. `expected` tells `none` from `unknown`.
RoundingSteps rounding_steps(const PixelHistory& history, const NoiseModel& expected);

/// Mean variance over time of readings with noise σ that are rounded to steps, over all places the truth may have
/// between two steps: σ² + step²/12 where σ is large, 0 where σ is 0.
double rounded_variance(double sigma, double step);
/// The σ that rounded_variance takes to this variance; 0 where there is none.
double sigma_before_rounding(double variance, double step);

/// One pixel of a still surface.
struct NoiseSample {
  double depth_m = 0.0;
  double incidence_rad = 0.0;
  double slope_m_per_px = 0.0;  ///< how much the depth changes over a pixel; z/f tan θ in the middle of the image
  double variance_m2 = 0.0;     ///< over time
};

/// The samples, and how still the scene was.
struct StillScene {
  std::vector<NoiseSample> samples;
  std::int64_t seen_pixels = 0;     ///< with a return in one of ten frames
  std::int64_t judged_pixels = 0;   ///< with one in nine of ten
  std::int64_t changed_pixels = 0;  ///< of these: drifting, jumping, or far noisier than others of their depth
  double correlation = 0.0;         ///< of one frame's error with the next one's, median over the samples
};
/// Surfaces are planes in inverse depth over 9×9 windows of the mean depth; no samples at edges and changed pixels.
StillScene still_scene(const PixelHistory& history, const Intrinsics& intrinsics, const RoundingSteps& steps);

/// Samples of like depth and incidence. The means are of what the model is linear in.
struct NoiseBin {
  std::int64_t pixels = 0;
  double depth_m = 0.0;
  double incidence_rad = 0.0;
  double grazing = 0.0;            ///< θ²/(π/2 − θ)² / √z
  double slope2_m2_per_px2 = 0.0;  ///< squared change of the depth over a pixel
  double variance_m2 = 0.0;        ///< without outliers
};
std::vector<NoiseBin> noise_bins(std::span<const NoiseSample> samples, const RoundingSteps& steps);

/// The fitted terms, in this order.
inline constexpr std::array<const char*, 5> kNoiseTerms{"axial_constant_m", "axial_quadratic_per_m",
                                                        "axial_reference_m", "axial_grazing", "lateral_px"};

struct NoiseFit {
  NoiseModel model;
  std::array<bool, 5> fitted{};  ///< by kNoiseTerms; the others are `start`'s: the bins can't tell them
};
/// Weighted robust least squares of σ. A term whose uncertainty is too large is held at start's value.
NoiseFit fit_noise_model(std::span<const NoiseBin> bins, std::int64_t frames, const RoundingSteps& steps,
                         const NoiseModel& start);

/// One line of the table: readings of about one depth.
struct NoiseTableRow {
  double depth_from_m = 0.0;
  double depth_to_m = 0.0;
  std::int64_t pixels = 0;
  double measured_m = 0.0;  ///< σ over time
  double model_m = 0.0;     ///< at the same depths, incidences and slopes
};

struct NoiseCalibration {
  NoiseModel model;
  std::vector<NoiseTableRow> rows;
  std::vector<std::string> notes;  ///< what could not be told from the recording, and what was left out
};

/// All of the above. The error says what is wrong with the recording: too few frames, or that something moved.
Expected<NoiseCalibration> calibrate_noise(const PixelHistory& history, const Intrinsics& intrinsics,
                                           const NoiseModel& start);

}  // namespace tubetrack
