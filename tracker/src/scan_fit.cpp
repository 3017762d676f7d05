#include "scan_fit.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "scan_step.hpp"

namespace tubetrack {

namespace {

constexpr int kOverlapSpans = 6;

std::vector<Eigen::Vector3d> evenly_around(const std::vector<Eigen::Vector3d>& ring_m, double spacing_m) {
  std::vector<double> along_m{0.0};
  for (std::size_t i = 1; i <= ring_m.size(); ++i)
    along_m.push_back(along_m.back() + (ring_m[i % ring_m.size()] - ring_m[i - 1]).norm());
  const int count = std::max(4, static_cast<int>(std::ceil(along_m.back() / spacing_m)));
  std::vector<Eigen::Vector3d> even;
  std::size_t from = 0;
  for (int i = 0; i < count; ++i) {
    const double at = along_m.back() * i / count;
    while (from + 2 < along_m.size() && along_m[from + 1] <= at) ++from;
    const double length = along_m[from + 1] - along_m[from];
    const double share = length > 0.0 ? (at - along_m[from]) / length : 0.0;
    even.emplace_back(ring_m[from] + share * (ring_m[(from + 1) % ring_m.size()] - ring_m[from]));
  }
  return even;
}

/// The control points that a closed line has twice are one.
void close_up(ScanLine& line) {
  auto& q = line.model.spline.control_m;
  const auto period = static_cast<std::size_t>(line.period);
  for (std::size_t k = 0; k + period < q.size(); ++k) {
    const Eigen::Vector3d mean = 0.5 * (q[k] + q[k + period]);
    q[k] = q[k + period] = mean;
  }
}

double robust_scale_m(std::vector<double>& residuals_m, double least_m) {
  constexpr double kSigmaOfMedian = 1.4826;
  if (residuals_m.empty()) return least_m;
  const auto middle = residuals_m.begin() + static_cast<std::ptrdiff_t>(residuals_m.size() / 2);
  std::nth_element(residuals_m.begin(), middle, residuals_m.end());
  return std::max(least_m, kSigmaOfMedian * *middle);
}

/// Surfels near a line as what it is fitted to, each made when it is asked for: a scan has many.
struct Observed {
  const SurfelGrid& grid;
  const std::vector<SurfacePoint>& points;
  double radius_m = 0.0;
  double scale_m = 0.0;
  double per_area = 1.0;
  double t_begin = 0.0, t_end = 1e9;  // what is fitted to lies in between

  bool is_fitted_to(const SurfacePoint& point) const { return point.t >= t_begin && point.t <= t_end; }
  Eigen::Vector3d point_m(std::uint32_t i) const {
    const SurfacePoint& point = points[i];
    return grid.surfels[point.surfel].position_m.cast<double>() - (point.lift_m * point.inward).cast<double>();
  }
  /// 1/σ²: with the robust one, (1 + far²)⁻².
  double weight(std::uint32_t i) const {
    constexpr double kDoubtful = 3.0;  // a residual of 3 σ counts a quarter
    const double far = (static_cast<double>(points[i].distance_m) - radius_m) / (kDoubtful * scale_m);
    const double area = std::max(1e-3, per_area * static_cast<double>(grid.surfels[points[i].surfel].weight));
    const double sigma_m = scale_m * (1.0 + far * far);
    return area / (sigma_m * sigma_m);
  }
};

Observed observed_of(const SurfelGrid& grid, const std::vector<SurfacePoint>& points, double radius_m,
                     double least_scale_m, const ScanFitOptions& options) {
  Observed observed{grid, points, radius_m, 0.0, 1.0, options.t_begin, options.t_end};
  std::vector<double> residuals_m;
  residuals_m.reserve(points.size());
  // The scale is that of surfels as they stand in the grid: one that is a mean of many errs by that, not less for its
  // area. Those of less than a grid step's square share their points with their neighbours.
  double sum_area = 0.0;
  for (const SurfacePoint& point : points) {
    if (!observed.is_fitted_to(point)) continue;
    residuals_m.push_back(std::abs(static_cast<double>(point.distance_m) - radius_m));
    sum_area += grid.surfels[point.surfel].weight;
  }
  const auto count = static_cast<double>(residuals_m.size());
  observed.scale_m = robust_scale_m(residuals_m, least_scale_m);
  if (!residuals_m.empty()) observed.per_area = count / std::max(sum_area, count);
  return observed;
}

constexpr int kWindowSpans = 512, kMarginSpans = 8;

struct Stretch {
  int begin = 0, end = 0;            // spans that the window is fitted over
  int core_begin = 0, core_end = 0;  // those that it speaks for
};

std::vector<Stretch> stretches_of(int spans) {
  if (spans <= kWindowSpans + 2 * kMarginSpans) return {{0, spans, 0, spans}};
  const int count = (spans + kWindowSpans - 1) / kWindowSpans;
  std::vector<Stretch> stretches;
  for (int i = 0; i < count; ++i) {
    const int begin = spans * i / count, end = spans * (i + 1) / count;
    stretches.push_back({std::max(0, begin - kMarginSpans), std::min(spans, end + kMarginSpans), begin, end});
  }
  return stretches;
}

/// The numbers of the points of each stretch.
std::vector<std::vector<std::uint32_t>> sorted_into(const std::vector<Stretch>& stretches, const Observed& observed) {
  const std::vector<SurfacePoint>& points = observed.points;
  std::vector<std::vector<std::uint32_t>> parts(stretches.size());
  const double per_span = static_cast<double>(stretches.size()) / stretches.back().end;
  for (std::uint32_t k = 0; k < points.size(); ++k) {
    if (!observed.is_fitted_to(points[k])) continue;
    const double t = points[k].t;
    // Windows overlap with their neighbours at most, and are alike to a span.
    const auto own = static_cast<std::size_t>(std::max(0.0, t * per_span));
    for (std::size_t i = own > 1 ? own - 2 : 0; i < std::min(own + 3, stretches.size()); ++i) {
      if (t >= stretches[i].begin && t <= stretches[i].end) parts[i].push_back(k);
    }
  }
  return parts;
}

/// By the stretches of the window's spline.
SortedObservations observations_in(const Stretch& stretch, const std::vector<std::uint32_t>& part,
                                   const Observed& observed, const Spline& spline) {
  const std::size_t stretches = (spline.control_m.size() - 3) * kStretchesPerSpan;
  const auto place_of = [&](std::uint32_t k) {
    return stretch_of(observed.points[k].t - static_cast<double>(stretch.begin), stretches);
  };
  RecycledVector<std::size_t> next(stretches, 0);
  for (const std::uint32_t k : part) ++next[place_of(k)];
  SortedObservations sorted;
  make_room(spline, next, sorted);
  for (const std::uint32_t k : part) {
    const std::size_t place = place_of(k);
    const std::size_t span = place / kStretchesPerSpan;
    const double s = std::clamp(observed.points[k].t - static_cast<double>(stretch.begin), 0.0, spline.spans());
    const Eigen::Vector3d from_origin_m = observed.point_m(k) - sorted.origin_m[span];
    put(from_origin_m.cast<float>(), observed.points[k].inward, static_cast<float>(observed.weight(k)),
        static_cast<float>(s - static_cast<double>(span)), next[place]++, sorted);
  }
  return sorted;
}

TubeModel window_of(const TubeModel& model, const Stretch& stretch) {
  const auto& q = model.spline.control_m;
  return {{{q.begin() + stretch.begin, q.begin() + stretch.end + 3}}, model.radius_m};
}

FitOptions window_options(const ScanFitOptions& options) {
  FitOptions window;
  window.radius_m = options.radius_m;
  window.radius_min_m = options.radius_min_m;
  window.radius_max_m = options.radius_max_m;
  window.gauss_newton_steps = options.steps;
  window.want_covariance = false;
  return window;
}

struct RadiusMean {
  double sum = 0.0, weights = 0.0;

  void add(double radius_m, double radius_sigma_m) {
    if (!(radius_sigma_m > 0.0)) return;
    const double weight = 1.0 / (radius_sigma_m * radius_sigma_m);
    sum += weight * radius_m;
    weights += weight;
  }
  double radius_m() const { return weights > 0.0 ? sum / weights : 0.0; }
  double sigma_m() const { return weights > 0.0 ? 1.0 / std::sqrt(weights) : 0.0; }
};

/// One radius for all windows: free in each, the mean of what they say. 0 where none says anything.
double pooled_radius_m(const ScanLine& line, const std::vector<Stretch>& stretches,
                       const std::vector<std::vector<std::uint32_t>>& parts, const Observed& observed,
                       const ScanFitOptions& options, double& sigma_m) {
  RadiusMean mean;
  FitOptions free = window_options(options);
  free.gauss_newton_steps = 1;
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    TubeModel window = window_of(line.model, stretches[i]);
    const SortedObservations observations = observations_in(stretches[i], parts[i], observed, window.spline);
    if (const auto quality = fit_scan_stretch(window, observations, free))
      mean.add(window.radius_m, quality->radius_sigma_m);
  }
  sigma_m = mean.sigma_m();
  return mean.radius_m();
}

/// Takes over the control points that a window speaks for.
void take_core(const Stretch& stretch, const Spline& window, Spline& spline) {
  const int first = stretch.core_begin == 0 ? 0 : stretch.core_begin + 1;
  const int last = stretch.end == stretch.core_end ? stretch.end + 2 : stretch.core_end + 1;
  for (int k = first; k <= last; ++k)
    spline.control_m[static_cast<std::size_t>(k)] = window.control_m[static_cast<std::size_t>(k - stretch.begin)];
}

/// Gauss-Newton in every window.
bool fit_windows(ScanLine& line, const Observed& observed, const ScanFitOptions& options, bool want_covariance,
                 ScanFit& fit) {
  const std::vector<Stretch> stretches = stretches_of(static_cast<int>(line.model.spline.spans()));
  const auto parts = sorted_into(stretches, observed);
  const bool whole = stretches.size() == 1;
  FitOptions fit_options = window_options(options);
  const bool own_radii = !whole && !options.radius_m && !options.one_radius;
  if (!whole && !options.radius_m && options.one_radius) {
    line.model.radius_m = pooled_radius_m(line, stretches, parts, observed, options, fit.radius_sigma_m);
    if (!(line.model.radius_m > 0.0)) return false;
    fit_options.radius_m = line.model.radius_m;
  }
  fit_options.want_covariance = want_covariance;
  RadiusMean radii;
  TubeModel fitted = line.model;
  fit.windows.clear();
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    TubeModel window = window_of(line.model, stretches[i]);
    auto quality =
        fit_scan_stretch(window, observations_in(stretches[i], parts[i], observed, window.spline), fit_options);
    if (!quality && whole) return false;
    if (!quality) continue;  // nothing is seen of it: it stays as it was traced
    if (whole) {
      fitted.radius_m = window.radius_m;
      fit.radius_sigma_m = quality->radius_sigma_m;
    }
    if (own_radii) radii.add(window.radius_m, quality->radius_sigma_m);
    take_core(stretches[i], window.spline, fitted.spline);
    fit.windows.push_back({static_cast<std::size_t>(stretches[i].begin), 1.0 * stretches[i].core_begin,
                           1.0 * stretches[i].core_end, std::move(window.spline), std::move(quality->covariance)});
  }
  line.model = std::move(fitted);
  if (own_radii && !fit.windows.empty()) {
    line.model.radius_m = radii.radius_m();
    fit.radius_sigma_m = radii.sigma_m();
  }
  return !fit.windows.empty() && line.model.radius_m > 0.0;
}

/// So little that the surfels that belong to the one belong to the other, but for some at the border.
bool moved_little(const TubeModel& before, const TubeModel& now) {
  constexpr double kLittleRadii = 0.2;
  const double little_m = kLittleRadii * now.radius_m;
  if (std::abs(now.radius_m - before.radius_m) > little_m) return false;
  const auto& from = before.spline.control_m;
  const auto& to = now.spline.control_m;
  return std::equal(from.begin(), from.end(), to.begin(), to.end(),
                    [&](const auto& a, const auto& b) { return (a - b).squaredNorm() <= little_m * little_m; });
}

}  // namespace

ScanLine scan_line_along(const std::vector<Eigen::Vector3d>& polyline_m, double radius_m, bool closed) {
  const double spacing_m = kKnotSpacingRadii * radius_m;
  ScanLine line;
  line.model.radius_m = radius_m;
  if (!closed) {
    line.model.spline = spline_along(polyline_m, spacing_m);
    return line;
  }
  const std::vector<Eigen::Vector3d> ring_m = evenly_around(polyline_m, spacing_m);
  line.overlap = kOverlapSpans;
  line.period = static_cast<int>(ring_m.size());
  for (int k = 0; k < line.period + 2 * line.overlap + 3; ++k) {
    const int at = (k - line.overlap + kOverlapSpans * line.period) % line.period;
    line.model.spline.control_m.push_back(ring_m[static_cast<std::size_t>(at)]);
  }
  return line;
}

std::optional<ScanFit> fit_scan_line(const SurfelGrid& grid, std::span<const char> taken, ScanLine& line,
                                     const ScanFitOptions& options, std::vector<SurfacePoint>& points) {
  ScanFit fit;
  if (options.radius_m) line.model.radius_m = *options.radius_m;
  points = points_near(grid, taken, line, options.every);
  for (int round = 0; round < options.rounds; ++round) {
    const TubeModel before = line.model;
    const double wide_m = round + 1 < options.rounds ? options.first_scale_radii * line.model.radius_m : 0.0;
    const double least_m = std::max(options.least_scale_m, std::ldexp(wide_m, -round));
    const Observed observed = observed_of(grid, points, line.model.radius_m, least_m, options);
    fit.scale_m = observed.scale_m;
    const bool last = round + 1 == options.rounds;
    if (!fit_windows(line, observed, options, last && options.want_covariance, fit)) return std::nullopt;
    if (line.closed()) close_up(line);
    if (moved_little(before, line.model)) {
      place_again(grid, line, points);
    } else {
      points = points_near(grid, taken, line, options.every);
    }
  }
  return fit;
}

}  // namespace tubetrack
