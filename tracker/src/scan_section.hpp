#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace tubetrack {

inline constexpr int kBins = 36;  ///< of a section, from its first axis on
inline constexpr double kBin_rad = 2.0 * std::numbers::pi / kBins;

/// Axes across a tube.
struct SectionAxes {
  Eigen::Vector3f e1, e2;
};

/// To 0.0003 rad, a five-hundredth of a bin; std::atan2 would be half of what a look takes.
inline float angle_of(const Eigen::Vector3f& outward, const SectionAxes& axes) {
  constexpr auto kPi = std::numbers::pi_v<float>;
  const float x = outward.dot(axes.e1), y = outward.dot(axes.e2);
  const float ax = std::abs(x), ay = std::abs(y);
  const float most = std::max(ax, ay);
  const float a = most > 0.0F ? std::min(ax, ay) / most : 0.0F;
  const float s = a * a;
  float angle = ((-0.0464964749F * s + 0.15931422F) * s - 0.327622764F) * s * a + a;
  if (ay > ax) angle = 0.5F * kPi - angle;
  if (x < 0.0F) angle = kPi - angle;
  return y < 0.0F ? -angle : angle;
}

/// Of angles from −2π to 2π.
inline int bin_of(float angle_rad) {
  constexpr auto kTurn = 2.0F * std::numbers::pi_v<float>;
  int bin = static_cast<int>((angle_rad + kTurn) * (kBins / kTurn));
  if (bin >= kBins) bin -= kBins;
  return bin >= kBins ? bin - kBins : bin;
}

/// The bins that a surfel reaching `half_rad` to either side fills.
inline std::uint64_t bins_around(float angle_rad, float half_rad) {
  const int first = bin_of(angle_rad - half_rad), last = bin_of(angle_rad + half_rad);
  const auto up_to = [](int bin) { return (std::uint64_t{2} << bin) - 1; };
  const std::uint64_t from_first = ~(up_to(first) >> 1), to_last = up_to(last);
  return (first <= last ? from_first & to_last : from_first | to_last) & up_to(kBins - 1);
}

}  // namespace tubetrack
