#include "scan_fit.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_map>

namespace tubetrack {

namespace {

constexpr int kOverlapSpans = 6;
constexpr int kNodesPerSpan = 2;
constexpr double kNearestRadii = 0.5, kFarthestRadii = 1.5;
constexpr double kLeastFacing = 0.5;  // 60°
constexpr double kMostAlong = 0.4;    // 24°

/// Nodes of a line by the cell of a coarse grid that they can be near to.
class NodeGrid {
 public:
  NodeGrid(const Spline& spline, double reach_m) : cell_m_(reach_m) {
    const int count = static_cast<int>(spline.spans()) * kNodesPerSpan;
    for (int i = 0; i <= count; ++i) {
      nodes_m_.push_back(point_at(spline, static_cast<double>(i) / kNodesPerSpan));
      box_.extend(nodes_m_.back());
      for (int k = 0; k < 27; ++k) {
        const Eigen::Vector3d shift = reach_m * Eigen::Vector3d(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
        nodes_of_[key_of(nodes_m_.back() + shift)].push_back(static_cast<std::uint32_t>(i));
      }
    }
    box_.min().array() -= reach_m;
    box_.max().array() += reach_m;
  }

  /// The nearest node's parameter; negative where none is within reach.
  double nearest(const Eigen::Vector3d& point_m) const {
    if (!box_.contains(point_m)) return -1.0;
    const auto cell = nodes_of_.find(key_of(point_m));
    if (cell == nodes_of_.end()) return -1.0;
    double least = cell_m_ * cell_m_;
    double t = -1.0;
    for (const std::uint32_t node : cell->second) {
      const double squared = (nodes_m_[node] - point_m).squaredNorm();
      if (squared >= least) continue;
      least = squared;
      t = static_cast<double>(node) / kNodesPerSpan;
    }
    return t;
  }

 private:
  std::uint64_t key_of(const Eigen::Vector3d& point_m) const {
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<std::int64_t>(std::floor(point_m[axis] / cell_m_));
      key = (key << 21) | (static_cast<std::uint64_t>(at + (1 << 20)) & 0x1FFFFFU);
    }
    return key;
  }

  double cell_m_;
  std::vector<Eigen::Vector3d> nodes_m_;
  Eigen::AlignedBox3d box_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> nodes_of_;
};

struct Foot {
  double t = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero(), derivative_m = Eigen::Vector3d::UnitX();
};

/// As foot_parameter, to a hundredth of a span: of a distance of R that is less than a ten-thousandth.
Foot foot_on(const std::vector<SpanPolynomial>& curve, const Eigen::Vector3d& point_m, double t) {
  const auto spans = static_cast<double>(curve.size());
  Foot foot;
  foot.t = std::clamp(t, 0.0, spans);
  constexpr int kRounds = 3;
  for (int i = 0;; ++i) {
    const std::size_t span = std::min(static_cast<std::size_t>(foot.t), curve.size() - 1);
    const auto& [c0, c1, c2, c3] = curve[span];
    const double s = foot.t - static_cast<double>(span);
    foot.position_m = c0 + s * (c1 + s * (c2 + s * c3));
    foot.derivative_m = c1 + s * (2.0 * c2 + (3.0 * s) * c3);
    const double speed2 = foot.derivative_m.squaredNorm();
    if (i == kRounds || !(speed2 > 0.0)) return foot;
    const double step = std::clamp((point_m - foot.position_m).dot(foot.derivative_m) / speed2, -0.5, 0.5);
    const double next = std::clamp(foot.t + step, 0.0, spans);
    if (std::abs(next - foot.t) < 0.01) return foot;
    foot.t = next;
  }
}

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

std::vector<Observation> observations_of(std::span<const Surfel> surfels, const std::vector<SurfacePoint>& points,
                                         double radius_m, double least_scale_m, double& scale_m) {
  std::vector<double> residuals_m;
  residuals_m.reserve(points.size());
  for (const SurfacePoint& point : points) residuals_m.push_back(std::abs(point.distance_m - radius_m));
  scale_m = robust_scale_m(residuals_m, least_scale_m);
  constexpr double kTuning = 3.0;  // a residual of 3 σ counts a quarter
  std::vector<Observation> observations;
  observations.reserve(points.size());
  for (const SurfacePoint& point : points) {
    const double far = (point.distance_m - radius_m) / (kTuning * scale_m);
    const double area = std::max(1e-3, static_cast<double>(surfels[point.surfel].weight));
    // The weight is 1/σ²: the robust one is (1 + far²)⁻².
    const double sigma_m = scale_m * (1.0 + far * far) / std::sqrt(area);
    observations.push_back({surfels[point.surfel].position_m.cast<double>(), point.inward, sigma_m, point.t});
  }
  return observations;
}

constexpr int kWindowSpans = 80, kMarginSpans = 12;

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

std::vector<std::vector<Observation>> sorted_into(const std::vector<Stretch>& stretches,
                                                  const std::vector<Observation>& all) {
  std::vector<std::vector<Observation>> parts(stretches.size());
  for (const Observation& observation : all) {
    // Windows overlap with their neighbours at most.
    for (std::size_t i = 0; i < stretches.size(); ++i) {
      if (observation.t < stretches[i].begin || observation.t > stretches[i].end) continue;
      parts[i].push_back(observation);
      parts[i].back().t -= stretches[i].begin;
    }
  }
  return parts;
}

TubeModel window_of(const TubeModel& model, const Stretch& stretch) {
  const auto& q = model.spline.control_m;
  return {{{q.begin() + stretch.begin, q.begin() + stretch.end + 3}}, model.radius_m};
}

/// Gauss-Newton in every window. One radius for all: a first time it is free in each, their mean is then held.
bool fit_windows(ScanLine& line, const std::vector<Observation>& observations, const ScanFitOptions& options,
                 bool want_covariance, ScanFit& fit) {
  const std::vector<Stretch> stretches = stretches_of(static_cast<int>(line.model.spline.spans()));
  const auto parts = sorted_into(stretches, observations);
  FitOptions fit_options;
  fit_options.radius_m = options.radius_m;
  fit_options.radius_min_m = options.radius_min_m;
  fit_options.radius_max_m = options.radius_max_m;
  fit_options.want_covariance = true;
  if (stretches.size() > 1 && !options.radius_m) {
    double sum = 0.0, weights = 0.0;
    for (std::size_t i = 0; i < stretches.size(); ++i) {
      TubeModel window = window_of(line.model, stretches[i]);
      const auto quality = fit_tube(window, parts[i], fit_options);
      if (!quality || !(quality->radius_sigma_m > 0.0)) continue;
      const double weight = 1.0 / (quality->radius_sigma_m * quality->radius_sigma_m);
      sum += weight * window.radius_m;
      weights += weight;
    }
    if (!(weights > 0.0)) return false;
    line.model.radius_m = sum / weights;
    fit.radius_sigma_m = 1.0 / std::sqrt(weights);
    fit_options.radius_m = line.model.radius_m;
  }
  fit_options.want_covariance = want_covariance;
  TubeModel fitted = line.model;
  fit.windows.clear();
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    const Stretch& stretch = stretches[i];
    TubeModel window = window_of(line.model, stretch);
    const auto quality = fit_tube(window, parts[i], fit_options);
    if (!quality) {
      if (stretches.size() == 1) return false;
      continue;  // nothing is seen of it: it stays as it was traced
    }
    if (stretches.size() == 1) {
      fitted.radius_m = window.radius_m;
      fit.radius_sigma_m = quality->radius_sigma_m;
    }
    const int first = stretch.core_begin == 0 ? 0 : stretch.core_begin + 1;
    const int last = stretch.end == stretch.core_end ? stretch.end + 2 : stretch.core_end + 1;
    for (int k = first; k <= last; ++k) {
      const auto at = static_cast<std::size_t>(k);
      fitted.spline.control_m[at] = window.spline.control_m[at - static_cast<std::size_t>(stretch.begin)];
    }
    fit.windows.push_back({static_cast<std::size_t>(stretch.begin), 1.0 * stretch.core_begin, 1.0 * stretch.core_end,
                           std::move(window.spline), quality->covariance});
  }
  line.model = std::move(fitted);
  return !fit.windows.empty();
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

std::vector<SurfacePoint> points_near(std::span<const Surfel> surfels, std::span<const char> taken,
                                      const ScanLine& line) {
  const Spline& spline = line.model.spline;
  const double radius_m = line.model.radius_m;
  // A node's own distance and half of that to the next one, which a bend may widen.
  const double reach_m = (kFarthestRadii + 0.5 * kKnotSpacingRadii) * radius_m;
  const NodeGrid grid(spline, reach_m);
  const std::vector<SpanPolynomial> curve = polynomials_of(spline);
  std::vector<SurfacePoint> points;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (!taken.empty() && taken[i] != 0) continue;
    const Eigen::Vector3d point_m = surfels[i].position_m.cast<double>();
    const double nearest = grid.nearest(point_m);
    if (nearest < 0.0) continue;
    SurfacePoint point;
    point.surfel = static_cast<std::uint32_t>(i);
    const Foot foot = foot_on(curve, point_m, nearest);
    point.t = foot.t;
    const Eigen::Vector3d to_axis = foot.position_m - point_m;
    point.distance_m = to_axis.norm();
    if (point.distance_m < kNearestRadii * radius_m || point.distance_m > kFarthestRadii * radius_m) continue;
    point.inward = to_axis / point.distance_m;
    // Beyond an end the foot stays there.
    const Eigen::Vector3d along = foot.derivative_m.normalized();
    if (std::abs(point.inward.dot(along)) > 0.1) continue;
    const Eigen::Vector3d normal = surfels[i].inward_normal.cast<double>();
    point.facing = point.inward.dot(normal);
    if (point.facing < kLeastFacing || std::abs(along.dot(normal)) > kMostAlong) continue;
    points.push_back(point);
    if (!line.closed()) continue;
    const double again = point.t + (point.t < 0.5 * spline.spans() ? line.period : -line.period);
    if (again < 0.0 || again > spline.spans()) continue;
    point.t = again;
    points.push_back(point);
  }
  return points;
}

std::optional<ScanFit> fit_scan_line(std::span<const Surfel> surfels, std::span<const char> taken, ScanLine& line,
                                     const ScanFitOptions& options) {
  ScanFit fit;
  if (options.radius_m) line.model.radius_m = *options.radius_m;
  for (int round = 0; round < options.rounds; ++round) {
    std::vector<SurfacePoint> points = points_near(surfels, taken, line);
    std::erase_if(points, [&](const SurfacePoint& at) { return at.t < options.t_begin || at.t > options.t_end; });
    const double wide_m = round + 1 < options.rounds ? options.first_scale_radii * line.model.radius_m : 0.0;
    const double least_m = std::max(options.least_scale_m, std::ldexp(wide_m, -round));
    const std::vector<Observation> observations =
        observations_of(surfels, points, line.model.radius_m, least_m, fit.scale_m);
    const bool last = round + 1 == options.rounds;
    if (!fit_windows(line, observations, options, last && options.want_covariance, fit)) return std::nullopt;
    if (line.closed()) close_up(line);
  }
  return fit;
}

}  // namespace tubetrack
