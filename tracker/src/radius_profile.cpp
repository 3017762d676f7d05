#include "tubetrack/tracker/radius_profile.hpp"

#include <algorithm>
#include <cmath>

namespace tubetrack {

SplineBasis profile_basis_at(const RadiusProfile& profile, const Spline& spline, double t) {
  const auto last_start = static_cast<double>(profile.offset_m.size()) - 4.0;
  const double at = (t + spline.first_span) / kProfileSpans - profile.first;
  const double clamped = std::clamp(at, 0.0, last_start + 1.0);
  const double whole = std::min(std::floor(clamped), last_start);
  const double s = clamped - whole;
  const double r = 1.0 - s;
  SplineBasis basis;
  basis.first = static_cast<std::size_t>(whole);
  basis.value = {r * r * r / 6.0, (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
                 (-3.0 * s * s * s + 3.0 * s * s + 3.0 * s + 1.0) / 6.0, s * s * s / 6.0};
  return basis;
}

double radius_offset_m(const RadiusProfile& profile, const Spline& spline, double t) {
  if (profile.offset_m.empty()) return 0.0;
  const SplineBasis basis = profile_basis_at(profile, spline, t);
  double offset_m = 0.0;
  for (std::size_t i = 0; i < 4; ++i) offset_m += basis.value[i] * profile.offset_m[basis.first + i];
  return offset_m;
}

void cover(RadiusProfile& profile, const Spline& spline) {
  const int first = static_cast<int>(std::floor(spline.first_span / kProfileSpans));
  const int last = static_cast<int>(std::ceil((spline.first_span + spline.spans()) / kProfileSpans)) + 2;
  auto& offset = profile.offset_m;
  if (offset.empty()) {
    profile.first = first;
    offset.assign(static_cast<std::size_t>(last - first) + 1, 0.0);
    return;
  }
  for (; profile.first > first; --profile.first) offset.insert(offset.begin(), 2.0 * offset[0] - offset[1]);
  while (profile.first + static_cast<int>(offset.size()) <= last)
    offset.push_back(2.0 * offset.back() - offset[offset.size() - 2]);
}

double spread_m(const RadiusProfile& profile) {
  if (profile.offset_m.empty()) return 0.0;
  const auto [least, most] = std::minmax_element(profile.offset_m.begin(), profile.offset_m.end());
  return *most - *least;
}

}  // namespace tubetrack
