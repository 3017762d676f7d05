#include "why_no_tube.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

namespace tubetrack {

namespace {

template <typename... Values>
Reason reason(fmt::format_string<Values...> text, Values&&... values) {
  Reason reason;
  fmt::format_to(std::back_inserter(reason), text, std::forward<Values>(values)...);
  return reason;
}

}  // namespace

std::optional<Reason> why_no_surface(const Evidence& e, double radius_m, const TrackerConfig& config) {
  if (radius_m < 0.94 * config.radius_min_m || radius_m > 1.06 * config.radius_max_m) {
    return reason("radius {:.4f} m out of range", radius_m);
  }
  if (e.length_m < std::max(config.min_length_radii * radius_m, config.min_length_m)) {
    return reason("length {:.3f} m is {:.2f} radii", e.length_m, e.length_m / radius_m);
  }
  if (e.min_bend_radii < config.min_bend_radii) return reason("a bend of {:.1f} radii", e.min_bend_radii);
  if (e.width_px < config.min_width_px) return reason("only {:.1f} px wide", e.width_px);
  if (e.arc_rad < std::numbers::pi / 2.0) return reason("only {:.0f}° of its section", e.arc_rad * 57.3);
  // On a short piece a bulge or a foot looks like taper.
  const double taper = std::abs(e.taper);
  if (taper > 0.09 || (taper > 0.055 && taper * e.length_m > 0.28 * radius_m))
    return reason("its radius changes by {:.0f} % of the length", 100.0 * taper);
  if (std::min(e.left.reach_radii, e.right.reach_radii) < 0.5) return "only one side is seen";
  if (e.support < 0.84) return reason("only {:.0f} % of its surface agrees", 100.0 * e.support);
  const bool clear =
      e.support > 0.88 && std::min(e.left.reach_radii, e.right.reach_radii) > 0.88 && e.noise_ratio < 1.2;
  if (e.length_m < 2.3 * radius_m && !clear) return "too short to be told from a lump";
  const double roughness_m = std::min(0.06 * radius_m, std::max(0.0008, 0.2 * e.sigma_m) + 0.005 * radius_m);
  if (e.profile_rms_radii * radius_m > roughness_m)
    return reason("profile off by {:.1f} mm", 1e3 * e.profile_rms_radii * radius_m);
  if (e.noise_ratio > 1.45) return reason("residuals {:.1f} times the noise", e.noise_ratio);
  if (radius_m < 3.5 * e.sigma_m) return reason("thinner than the noise of {:.1f} mm shows", 1e3 * e.sigma_m);
  return std::nullopt;
}

bool hopeless(const Evidence& e, double radius_m, const TrackerConfig& config) {
  const bool in_range = radius_m > 0.75 * config.radius_min_m && radius_m < 1.25 * config.radius_max_m;
  return !in_range || e.length_m < 0.6 * std::max(config.min_length_radii * radius_m, config.min_length_m) ||
         e.min_bend_radii < 0.75 * config.min_bend_radii || e.arc_rad < 1.4 ||
         std::abs(e.taper) - 2.0 * e.taper_sigma > 0.11 || e.support < 0.7 || e.profile_rms_radii > 0.09 ||
         e.noise_ratio > 2.0;
}

std::optional<Reason> why_no_tube(const Evidence& e, double radius_m, const TrackerConfig& config) {
  if (auto reason = why_no_surface(e, radius_m, config)) return reason;
  if (!e.turns_away()) return "the surface goes on beyond both sides";
  const double straight = std::max(e.left.straight_share, e.right.straight_share);
  if (!e.is_round() && (e.edge_share > 0.45 || straight > 0.6)) return "goes straight on beyond a side";
  return std::nullopt;
}

}  // namespace tubetrack
