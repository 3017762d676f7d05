#include "scan_grow.hpp"

#include <algorithm>
#include <cmath>

namespace tubetrack {

namespace {

constexpr int kMaxRounds = 64;
constexpr double kLeastScaleSteps = 0.02;

ScanFitOptions fit_options(const ScanSurface& surface, const ScanTubesConfig& config, int rounds) {
  ScanFitOptions options;
  options.radius_m = config.radius_m;
  // What has converged is asked again by find_scan_tubes; on its way a fit may stray.
  options.radius_min_m = 0.7 * config.radius_min_m;
  options.radius_max_m = 1.4 * config.radius_max_m;
  options.least_scale_m = kLeastScaleSteps * surface.spacing_m;
  options.rounds = rounds;
  return options;
}

bool fit_and_look(const ScanSurface& surface, const ScanTubesConfig& config, const ScanFitOptions& options,
                  ScanTube& tube) {
  auto fit = fit_scan_line(surface.surfels, surface.taken, tube.line, options);
  if (!fit) return false;
  tube.fit = std::move(*fit);
  tube.evidence = look_at(surface.surfels, points_near(surface.surfels, surface.taken, tube.line), tube.line,
                          surface.spacing_m, tube.fit.scale_m, config.min_arc_rad);
  return tube.evidence.t_end > tube.evidence.t_begin;
}

/// Leaves the seen stretch and up to a span beyond either end. True where something was cut off.
bool trim(ScanTube& tube) {
  auto& q = tube.line.model.spline.control_m;
  const double spans = tube.line.model.spline.spans();
  const double margin = 1.0;
  const double begin = std::max(0.0, std::floor(tube.evidence.t_begin - margin));
  const double end = std::min(spans, std::ceil(tube.evidence.t_end + margin));
  if (begin <= 0.0 && end >= spans) return false;
  q = {q.begin() + static_cast<std::ptrdiff_t>(begin), q.begin() + static_cast<std::ptrdiff_t>(end) + 3};
  tube.line.overlap = tube.line.period = 0;
  tube.evidence.t_begin -= begin;
  tube.evidence.t_end -= begin;
  return true;
}

bool goes_all_around(const ScanTube& tube) {
  return tube.line.closed() && tube.evidence.t_begin <= tube.line.overlap &&
         tube.evidence.t_end >= tube.line.overlap + tube.line.period;
}

/// A line whose ends meet, head to tail, becomes a closed one.
bool close_if_ends_meet(ScanTube& tube) {
  const Spline& spline = tube.line.model.spline;
  const double radius_m = tube.line.model.radius_m;
  const double begin = tube.evidence.t_begin, end = tube.evidence.t_end;
  if (tube.line.closed() || end - begin < 5.0) return false;
  const Eigen::Vector3d gap_m = point_at(spline, begin) - point_at(spline, end);
  if (gap_m.norm() > 1.5 * radius_m) return false;
  const Eigen::Vector3d out = derivative_at(spline, end).normalized(), in = derivative_at(spline, begin).normalized();
  constexpr double kSameWay = 0.5;
  if (out.dot(in) < kSameWay) return false;
  const bool overlaps = gap_m.dot(out) < 0.0;
  const double last = overlaps ? end - std::min(2.0, 0.5 * gap_m.norm() / radius_m + 0.5) : end;
  std::vector<Eigen::Vector3d> ring_m;
  const int count = static_cast<int>(std::ceil(2.0 * (last - begin)));
  for (int i = 0; i <= count; ++i) ring_m.push_back(point_at(spline, begin + (last - begin) * i / count));
  tube.line = scan_line_along(ring_m, radius_m, true);
  return true;
}

/// Which ends are seen to the last.
std::pair<bool, bool> ends_go_on(const ScanTube& tube) {
  const double near = 0.6;  // a span is 1.25 R, a station 0.4 spans
  return {tube.evidence.t_begin < near, tube.line.model.spline.spans() - tube.evidence.t_end < near};
}

}  // namespace

std::optional<ScanTube> grow_scan_tube(const ScanSurface& surface, const ScanSeed& seed,
                                       const ScanTubesConfig& config) {
  ScanTube tube;
  tube.line = scan_line_along(seed.line_m, config.radius_m.value_or(seed.radius_m), seed.closed);
  const ScanFitOptions first = fit_options(surface, config, 3), again = fit_options(surface, config, 1);
  if (!fit_and_look(surface, config, first, tube)) return std::nullopt;
  for (int round = 0; round < kMaxRounds && !goes_all_around(tube); ++round) {
    const bool closing = close_if_ends_meet(tube);
    if (!closing) {
      trim(tube);
      const auto [front, back] = ends_go_on(tube);
      if (!front && !back) break;
      extend(tube.line.model.spline, front, back);
    }
    if (!fit_and_look(surface, config, closing ? first : again, tube)) return std::nullopt;
  }
  if (!goes_all_around(tube) && trim(tube) && !fit_and_look(surface, config, again, tube)) return std::nullopt;
  if (why_no_scan_tube(tube.evidence, tube.line.model.radius_m, config)) return std::nullopt;
  return tube;
}

bool refine_scan_tube(const ScanSurface& surface, const ScanTubesConfig& config, ScanTube& tube) {
  ScanFitOptions options = fit_options(surface, config, 2);
  if (!fit_and_look(surface, config, options, tube)) return false;
  if (!goes_all_around(tube)) trim(tube);
  options.want_covariance = true;
  if (!fit_and_look(surface, config, options, tube)) return false;
  return !why_no_scan_tube(tube.evidence, tube.line.model.radius_m, config);
}

}  // namespace tubetrack
