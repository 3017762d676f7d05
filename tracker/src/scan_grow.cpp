#include "scan_grow.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tubetrack {

namespace {

constexpr int kMaxRounds = 64;
constexpr double kLeastScaleSteps = 0.02;
// So far from an octave's radii a seed's may be, and a tube's, which may get thicker or thinner.
constexpr double kSeedBelow = 0.9, kSeedAbove = 1.1, kTubeBelow = 0.75, kTubeAbove = 1.33;

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

/// Of a line that may lie far off.
ScanFitOptions first_options(const ScanSurface& surface, const ScanTubesConfig& config) {
  ScanFitOptions options = fit_options(surface, config, 3);
  options.first_scale_radii = 0.2;  // or an oval is taken for the rounder of its sides
  return options;
}

bool fit_and_look(const ScanSurface& surface, const ScanTubesConfig& config, const ScanFitOptions& options,
                  ScanTube& tube) {
  std::vector<SurfacePoint> points;
  auto fit = fit_scan_line(surface.grid, surface.taken, tube.line, options, points);
  if (!fit) return false;
  tube.fit = std::move(*fit);
  tube.evidence = look_at(surface.grid.surfels, points, options.every, tube.line, surface.spacing_m, tube.fit.scale_m,
                          config.min_arc_rad);
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

/// Points of the line two a span, once around a closed one.
std::vector<Eigen::Vector3d> points_of(const ScanLine& line) {
  const double begin = line.overlap, spans = line.closed() ? line.period : line.model.spline.spans();
  const int count = 2 * static_cast<int>(std::lround(spans));
  std::vector<Eigen::Vector3d> points_m;
  points_m.reserve(static_cast<std::size_t>(count) + 1);
  for (int i = 0; i < count + (line.closed() ? 0 : 1); ++i)
    points_m.push_back(point_at(line.model.spline, begin + 0.5 * i));
  return points_m;
}

/// Knots as far apart as the radius asks for: a seed's radius may be off by half. True where they were not.
bool knot_again(ScanTube& tube) {
  const Spline& spline = tube.line.model.spline;
  const double middle = std::floor(0.5 * spline.spans());
  const double spacing_m = (point_at(spline, middle + 1.0) - point_at(spline, middle)).norm();
  const double wanted_m = kKnotSpacingRadii * tube.line.model.radius_m;
  constexpr double kNear = 0.1;
  if (std::abs(spacing_m - wanted_m) < kNear * wanted_m) return false;
  const double old_spans = spline.spans();
  const bool closed = tube.line.closed();
  tube.line = scan_line_along(points_of(tube.line), tube.line.model.radius_m, closed);
  if (closed) {
    tube.evidence.t_begin = tube.line.overlap;
    tube.evidence.t_end = tube.line.overlap + tube.line.period;
  } else {
    tube.evidence.t_begin *= tube.line.model.spline.spans() / old_spans;
    tube.evidence.t_end *= tube.line.model.spline.spans() / old_spans;
  }
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
  constexpr double kNearRadii = 2.5;
  if (gap_m.norm() > kNearRadii * radius_m) return false;
  const Eigen::Vector3d out = derivative_at(spline, end).normalized(), in = derivative_at(spline, begin).normalized();
  constexpr double kSameWay = 0.5;
  if (out.dot(in) < kSameWay || (gap_m.norm() > radius_m && std::abs(out.dot(gap_m)) < kSameWay * gap_m.norm()))
    return false;
  const bool overlaps = gap_m.dot(out) < 0.0;
  const double last = overlaps ? end - std::min(2.0, 0.5 * gap_m.norm() / radius_m + 0.5) : end;
  std::vector<Eigen::Vector3d> ring_m;
  const int count = static_cast<int>(std::ceil(2.0 * (last - begin)));
  ring_m.reserve(static_cast<std::size_t>(count) + 1);
  for (int i = 0; i <= count; ++i) ring_m.push_back(point_at(spline, begin + (last - begin) * i / count));
  tube.line = scan_line_along(ring_m, radius_m, true);
  return true;
}

/// Points of the seen stretch, its ends among them.
std::vector<Eigen::Vector3d> seen_points_of(const ScanTube& tube) {
  const double begin = tube.evidence.t_begin, end = tube.evidence.t_end;
  const int count = std::max(2, static_cast<int>(std::ceil(2.0 * (end - begin))));
  std::vector<Eigen::Vector3d> points_m;
  points_m.reserve(static_cast<std::size_t>(count) + 1);
  for (int i = 0; i <= count; ++i)
    points_m.push_back(point_at(tube.line.model.spline, begin + (end - begin) * i / count));
  return points_m;
}

/// What a surface may scatter by follows from how far apart the scan's own points are, not means of them.
void judge_by_scan(const ScanTubesConfig& config, ScanTube& tube) {
  tube.evidence.spacing_radii = std::min(tube.evidence.spacing_radii, config.grid_step_m / tube.line.model.radius_m);
}

/// Which ends are seen to the last.
std::pair<bool, bool> ends_go_on(const ScanTube& tube) {
  const double near = 0.6;  // a span is 1.25 R, a station 0.4 spans
  return {tube.evidence.t_begin < near, tube.line.model.spline.spans() - tube.evidence.t_end < near};
}

/// Every so many surfels suffice while a line grows: those of a span are some two dozen then.
std::size_t enough(double radius_m, double cell_m) {
  constexpr double kOfSpan = 24.0;
  const double cells = 2.0 * std::numbers::pi * kKnotSpacingRadii * radius_m * radius_m / (cell_m * cell_m);
  return static_cast<std::size_t>(std::clamp(cells / kOfSpan, 1.0, 1000.0));
}

}  // namespace

bool fit_seed(const ScanSurface& surface, const Octave& octave, const ScanTubesConfig& config, ScanSeed& seed) {
  ScanTube piece;
  piece.line = scan_line_along(seed.line_m, config.radius_m.value_or(seed.radius_m), false);
  ScanFitOptions options = first_options(surface, config);
  options.radius_min_m = kSeedBelow * octave.radius_min_m;
  options.radius_max_m = kSeedAbove * octave.radius_max_m;
  if (!fit_and_look(surface, config, options, piece)) return false;
  seed.radius_m = piece.line.model.radius_m;
  const ScanEvidence& evidence = piece.evidence;
  // Rounded edges and the like; of a section seen all around, which may be an oval, more is let pass.
  constexpr double kLeastSupport = 0.5, kMostScatter = 0.1, kMostOfStep = 0.5;
  const double most_scatter = std::max(kMostScatter, kMostOfStep * config.grid_step_m / seed.radius_m);
  const bool all_around = evidence.arc_rad >= kAllAround_rad;
  seed.certain = all_around && is_certain(evidence);
  return (all_around || evidence.scale_radii <= most_scatter) && evidence.support >= kLeastSupport;
}

bool is_of_octave(double radius_m, const Octave& octave, const ScanTubesConfig& config) {
  return config.radius_m ||
         (radius_m >= kTubeBelow * octave.radius_min_m && radius_m <= kTubeAbove * octave.radius_max_m);
}

std::optional<ScanTube> grow_scan_tube(const ScanSurface& surface, const ScanSeed& seed,
                                       const ScanTubesConfig& config) {
  ScanTube tube;
  tube.line = scan_line_along(seed.line_m, config.radius_m.value_or(seed.radius_m), seed.closed);
  ScanFitOptions first = first_options(surface, config), again = fit_options(surface, config, 1);
  constexpr double kLongSpans = 8.0;  // a short piece wants all that there is
  if (tube.line.model.spline.spans() > kLongSpans) {
    if (!seed.closed) extend(tube.line.model.spline, true, true);  // a trace stops a step before the end
    for (ScanFitOptions* options : {&first, &again}) {
      options->steps = 1;
      options->one_radius = false;
      options->every = enough(tube.line.model.radius_m, surface.grid.cell_m);
    }
    // Seen from one side, place and radius make up for each other, and take longer to settle.
    first.rounds = seed.certain ? 2 : 4;
  }
  if (!fit_and_look(surface, config, first, tube)) return std::nullopt;
  if (knot_again(tube) && !fit_and_look(surface, config, again, tube)) return std::nullopt;
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
  judge_by_scan(config, tube);
  return tube;
}

std::optional<ScanTube> join_scan_tubes(const ScanSurface& surface, const ScanTubesConfig& config, const ScanTube& a,
                                        const ScanTube& b) {
  if (a.line.closed() || b.line.closed()) return std::nullopt;
  constexpr double kNearRadii = 3.0, kSameRadius = 0.3, kSameWay = 0.7;
  const double radius_m = 0.5 * (a.line.model.radius_m + b.line.model.radius_m);
  if (std::abs(a.line.model.radius_m - b.line.model.radius_m) > kSameRadius * radius_m) return std::nullopt;
  for (int ends = 0; ends < 4; ++ends) {
    std::vector<Eigen::Vector3d> line_m = seen_points_of(a), other_m = seen_points_of(b);
    if ((ends & 1) != 0) std::reverse(line_m.begin(), line_m.end());
    if ((ends & 2) != 0) std::reverse(other_m.begin(), other_m.end());
    const Eigen::Vector3d gap_m = other_m.front() - line_m.back();
    const Eigen::Vector3d out = (line_m.back() - line_m[line_m.size() - 2]).normalized();
    const Eigen::Vector3d in = (other_m[1] - other_m.front()).normalized();
    if (gap_m.norm() > kNearRadii * radius_m || out.dot(in) < kSameWay) continue;
    // Beside each other is not one behind the other.
    if (gap_m.norm() > radius_m && out.dot(gap_m) < kSameWay * gap_m.norm()) continue;
    while (line_m.size() > 2 && out.dot(other_m.front() - line_m.back()) < 0.5 * radius_m) line_m.pop_back();
    line_m.insert(line_m.end(), other_m.begin(), other_m.end());
    ScanTube joined;
    joined.line = scan_line_along(line_m, radius_m, false);
    joined.evidence.t_end = joined.line.model.spline.spans();
    if (!refine_scan_tube(surface, config, false, joined)) continue;
    constexpr double kWhole = 0.95;
    if (joined.evidence.length_m < kWhole * (a.evidence.length_m + b.evidence.length_m)) continue;
    return joined;
  }
  return std::nullopt;
}

bool refine_scan_tube(const ScanSurface& surface, const ScanTubesConfig& config, bool fitted, ScanTube& tube) {
  ScanFitOptions options = fit_options(surface, config, 1);
  if ((knot_again(tube) || !fitted) && !fit_and_look(surface, config, options, tube)) return false;
  // Of two pieces that were joined the other ends may meet too.
  if (close_if_ends_meet(tube) && !fit_and_look(surface, config, options, tube)) return false;
  if (!goes_all_around(tube)) trim(tube);
  options.want_covariance = true;
  // At an end a rounded edge, or what it is held by, bends the line into a hook.
  constexpr double kUnfitted = 0.6;  // spans: 0.75 radii
  if (!goes_all_around(tube) && tube.evidence.t_end - tube.evidence.t_begin > 8.0 * kUnfitted) {
    options.t_begin = tube.evidence.t_begin + kUnfitted;
    options.t_end = tube.evidence.t_end - kUnfitted;
  }
  if (!fit_and_look(surface, config, options, tube)) return false;
  judge_by_scan(config, tube);
  return !why_no_scan_tube(tube.evidence, tube.line.model.radius_m, config);
}

}  // namespace tubetrack
