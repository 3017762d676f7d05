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
  Eigen::Vector3d e1, e2;
};

/// To 0.0003 rad, a five-hundredth of a bin; std::atan2 would be half of what a look takes.
inline double angle_of(const Eigen::Vector3d& outward, const SectionAxes& axes) {
  const double x = outward.dot(axes.e1), y = outward.dot(axes.e2);
  const double ax = std::abs(x), ay = std::abs(y);
  const double most = std::max(ax, ay);
  const double a = most > 0.0 ? std::min(ax, ay) / most : 0.0;
  const double s = a * a;
  double angle = ((-0.0464964749 * s + 0.15931422) * s - 0.327622764) * s * a + a;
  if (ay > ax) angle = 0.5 * std::numbers::pi - angle;
  if (x < 0.0) angle = std::numbers::pi - angle;
  return y < 0.0 ? -angle : angle;
}

/// Of angles from −2π on.
inline int bin_of(double angle_rad) {
  return static_cast<int>((angle_rad + 2.0 * std::numbers::pi) / kBin_rad) % kBins;
}

/// The bins that a surfel reaching `half_rad` to either side fills.
inline std::uint64_t bins_around(double angle_rad, double half_rad) {
  const int first = bin_of(angle_rad - half_rad), last = bin_of(angle_rad + half_rad);
  const auto up_to = [](int bin) { return (std::uint64_t{2} << bin) - 1; };
  const std::uint64_t from_first = ~(up_to(first) >> 1), to_last = up_to(last);
  return (first <= last ? from_first & to_last : from_first | to_last) & up_to(kBins - 1);
}

}  // namespace tubetrack
