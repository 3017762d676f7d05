#include "tubetrack/tracker/grow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tubetrack {

namespace {

double spacing_m(const Spline& spline) { return (spline.control_m[2] - spline.control_m[1]).norm(); }

/// Makes the spline end within a span of what is seen, and reach beyond it. True when it changed.
bool follow_extent(Spline& spline, const Extent& extent) {
  bool changed = false;
  const double spans = spline.spans();
  auto& q = spline.control_m;
  if (extent.t_end > spans - 0.3) {
    extend(spline, false, true);
    changed = true;
  } else {
    const int spare = static_cast<int>(std::floor(spans - extent.t_end - 0.7));
    for (int i = 0; i < spare && q.size() > 5; ++i) q.pop_back();
  }
  if (extent.t_begin < 0.3) {
    extend(spline, true, false);
    changed = true;
  } else {
    const int spare = static_cast<int>(std::floor(extent.t_begin - 0.7));
    for (int i = 0; i < spare && q.size() > 5; ++i) q.erase(q.begin());
  }
  return changed || spans != spline.spans();
}

}  // namespace

std::optional<FoundTube> grow_tube(const HeightMap& map, const TrackerConfig& config,
                                   const std::vector<Eigen::Vector3d>& line_m, double radius_m) {
  constexpr int kMaxRounds = 40;
  FoundTube found;
  found.model.radius_m = config.radius_m.value_or(radius_m);
  found.model.spline = spline_along(line_m, 1.25 * found.model.radius_m);
  FitOptions options;
  options.radius_m = config.radius_m;
  options.radius_min_m = 0.5 * config.radius_min_m;
  options.radius_max_m = 1.5 * config.radius_max_m;
  bool settled = false;
  for (int round = 0; round < kMaxRounds; ++round) {
    const double gate_m = (round == 0 ? 0.4 : round == 1 ? 0.25 : 0.1) * found.model.radius_m;
    found.pixels = predict_pixels(map, found.model);
    const auto observations = select_observations(map, config.noise, found.pixels, gate_m, 4.0);
    auto quality = fit_tube(found.model, observations, options);
    if (!quality) return std::nullopt;
    found.quality = std::move(*quality);
    found.pixels = predict_pixels(map, found.model);
    const double station_m = station_length_m(map, found.model);
    const auto stations = stations_of(map, config.noise, found.model, found.pixels, station_m);
    found.extent = seen_extent(stations, station_m, 4.0 * found.model.radius_m);
    if (found.extent.t_end <= found.extent.t_begin) return std::nullopt;
    if (settled && round >= 4) break;
    if (round + 1 < kMaxRounds) settled = !follow_extent(found.model.spline, found.extent);
    if (spacing_m(found.model.spline) < 1e-4) return std::nullopt;
  }
  found.evidence = gather_evidence(map, config.noise, found.model, found.pixels, found.extent);
  return found;
}

std::optional<std::string> why_no_tube(const FoundTube& found, const TrackerConfig& config) {
  const Evidence& e = found.evidence;
  const double radius = found.model.radius_m;
  if (radius < 0.94 * config.radius_min_m || radius > 1.06 * config.radius_max_m) {
    return fmt::format("radius {:.4f} m out of range", radius);
  }
  if (e.length_m < std::max(config.min_length_radii * radius, config.min_length_m)) {
    return fmt::format("length {:.3f} m is {:.2f} radii", e.length_m, e.length_m / radius);
  }
  if (e.width_px < config.min_width_px) return fmt::format("only {:.1f} px wide", e.width_px);
  if (e.arc_rad < std::numbers::pi / 2.0) return fmt::format("only {:.0f}° of its section", e.arc_rad * 57.3);
  if (e.support < 0.6) return fmt::format("support {:.2f}", e.support);
  if (e.profile_rms_radii > 0.06) return fmt::format("profile off by {:.3f} radii", e.profile_rms_radii);
  return std::nullopt;
}

}  // namespace tubetrack
