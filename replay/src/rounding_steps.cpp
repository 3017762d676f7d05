#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <vector>

#include "tubetrack/replay/noise_calibration.hpp"

namespace tubetrack {

namespace {

constexpr std::size_t kMinLevels = 20;  ///< fewer distinct depths could be anything
constexpr std::uint64_t kMinCount = 20;
constexpr double kRarer = 4.0;  ///< a depth this many times rarer than its neighbour is there by mixed pixels only

/// Every count is a multiple of this (of all but 1 in 200: mixed pixels of a filter).
std::size_t common_divisor(const std::vector<std::uint64_t>& levels) {
  const std::uint64_t all = std::accumulate(levels.begin(), levels.end(), std::uint64_t{0});
  for (std::size_t divisor = 100; divisor > 1; --divisor) {
    std::uint64_t multiples = 0;
    std::size_t distinct = 0;
    for (std::size_t value = divisor; value < levels.size(); value += divisor) {
      multiples += levels[value];
      distinct += levels[value] > 0 ? 1 : 0;
    }
    if (distinct >= kMinLevels && multiples * 200 >= all * 199) return divisor;
  }
  return 1;
}

/// How often each depth occurs, by steps of depth.
std::vector<std::uint64_t> counts_of(const std::vector<std::uint64_t>& levels, std::size_t divisor) {
  std::vector<std::uint64_t> counts;
  for (std::size_t value = 0; value < levels.size(); value += divisor) counts.push_back(levels[value]);
  counts.push_back(0);
  return counts;
}

bool stands_out(std::uint64_t count, std::uint64_t neighbour) {
  return static_cast<double>(count) > kRarer * static_cast<double>(neighbour);
}

/// The depths, in steps of depth, whose two neighbours hardly occur: the teeth of a comb that is wider than these
/// steps.
std::vector<double> teeth_of(const std::vector<std::uint64_t>& counts) {
  std::vector<double> teeth;
  for (std::size_t i = 1; i + 1 < counts.size(); ++i) {
    if (counts[i] < kMinCount || !stands_out(counts[i], counts[i - 1]) || !stands_out(counts[i], counts[i + 1])) {
      continue;
    }
    teeth.push_back(static_cast<double>(i));
  }
  return teeth;
}

/// Median difference of inverse depth between neighbouring teeth, of the farther half, where it is known best. Gaps of
/// 4 % and more are between surfaces.
double usual_inverse_step(const std::vector<double>& teeth) {
  std::vector<double> steps;
  for (std::size_t i = teeth.size() / 2; i + 1 < teeth.size(); ++i) {
    if (teeth[i + 1] - teeth[i] <= 0.04 * teeth[i]) steps.push_back(1.0 / teeth[i] - 1.0 / teeth[i + 1]);
  }
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

/// How well the inverse depths lie on a comb of this step, whatever its phase: 1 exactly, about 1/√n by chance.
double on_comb(const std::vector<double>& inverse, double step) {
  std::complex<double> sum = 0.0;
  for (const double w : inverse) sum += std::polar(1.0, 2.0 * std::numbers::pi * w / step);
  return std::abs(sum) / static_cast<double>(inverse.size());
}

/// The comb's step near the usual one, in inverse steps of depth; 0 where there is no comb.
double comb_step(const std::vector<double>& teeth) {
  const double usual = usual_inverse_step(teeth);
  if (usual <= 0.0 || teeth.size() < kMinLevels) return 0.0;
  std::vector<double> inverse;
  double expected = 0.0;  // of on_comb: teeth are off the comb by their own rounding
  for (const double z : teeth) {
    const double angle = std::numbers::pi / std::max(z * z * usual, 1.5);
    inverse.push_back(1.0 / z);
    expected += std::sin(angle) / angle / static_cast<double>(teeth.size());
  }
  const double range = inverse.front() - inverse.back();
  const double fine = std::clamp(0.1 * usual / range, 1e-5, 0.01);
  double best = 0.0;
  double best_fit = 0.0;
  for (double step = 0.75 * usual; step < 1.33 * usual; step *= 1.0 + fine) {
    const double fit = on_comb(inverse, step);
    if (fit > best_fit) {
      best_fit = fit;
      best = step;
    }
  }
  // Of twenty teeth anywhere the best of all these combs has about 0.7.
  const double by_chance = 3.3 / std::sqrt(static_cast<double>(inverse.size()));
  return best_fit > std::max(0.7 * expected, std::min(by_chance, 0.85)) ? best : 0.0;
}

}  // namespace

double RoundingSteps::at(double z) const {
  return std::hypot(depth_m, z * z * inverse_depth_per_m);
}

RoundingSteps rounding_steps(const PixelHistory& history, const NoiseModel& expected) {
  RoundingSteps steps;
  const std::size_t divisor = common_divisor(history.levels);
  steps.depth_m = static_cast<double>(divisor) * history.metres_per_unit;
  const double expected_step = expected.disparity_step_px / expected.baseline_focal_m_px;
  const std::vector<std::uint64_t> counts = counts_of(history.levels, divisor);
  if (const double step = comb_step(teeth_of(counts)); step > 0.0) {
    steps.disparity = RoundingSteps::Disparity::seen;
    steps.inverse_depth_per_m = step / steps.depth_m;
    return steps;
  }
  // Where the expected steps would leave gaps, do neighbouring depths occur alike?
  std::size_t alike = 0;
  std::size_t unlike = 0;
  for (std::size_t i = 1; i + 1 < counts.size(); ++i) {
    const double z = static_cast<double>(i) * steps.depth_m;
    if (z * z * expected_step < 2.0 * steps.depth_m || counts[i] < kMinCount) continue;
    ++(stands_out(counts[i], counts[i - 1]) && stands_out(counts[i], counts[i + 1]) ? unlike : alike);
  }
  if (alike >= kMinLevels && alike > 4 * unlike) steps.disparity = RoundingSteps::Disparity::none;
  if (steps.disparity == RoundingSteps::Disparity::unknown) steps.inverse_depth_per_m = expected_step;
  return steps;
}

double rounded_variance(double sigma, double step) {
  if (step <= 0.0) return sigma * sigma;
  // What rounding adds, less the part that stays the same from reading to reading (Fourier series of the sawtooth).
  const double decay = 2.0 * std::numbers::pi * sigma / step;
  double constant_part = 0.0;
  for (int k = 1; k <= 2000; ++k) {
    const double term = std::exp(-decay * decay * k * k) / (static_cast<double>(k) * k);
    if (term < 1e-12) break;
    constant_part += term;
  }
  const double pi2 = std::numbers::pi * std::numbers::pi;
  return std::max(sigma * sigma + step * step * (1.0 / 12.0 - constant_part / (2.0 * pi2)), 0.0);
}

double sigma_before_rounding(double variance, double step) {
  // Of σ = 0 the series is cut short: a variance of less than that is none.
  if (variance <= rounded_variance(0.0, step)) return 0.0;
  double low = 0.0;
  double high = std::sqrt(variance) + step;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (rounded_variance(middle, step) < variance ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace tubetrack
