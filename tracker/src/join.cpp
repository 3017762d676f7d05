#include "tubetrack/tracker/join.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

constexpr double kMaxGapRadii = 16.0;
constexpr double kCos35 = 0.82;
constexpr int kMaxOverlap = 4;  // points, about a radius apart

/// Points along the extent of a model, about a radius apart.
RecycledVector<Eigen::Vector3d> line_of(const FoundTube& tube, bool backwards) {
  const int pieces = std::max(3, static_cast<int>(std::ceil(tube.evidence.length_m / tube.model.radius_m)));
  RecycledVector<Eigen::Vector3d> line;
  for (int i = 0; i <= pieces; ++i) {
    const double s = static_cast<double>(backwards ? pieces - i : i) / pieces;
    line.push_back(point_at(tube.model.spline, tube.extent.t_begin + s * (tube.extent.t_end - tube.extent.t_begin)));
  }
  return line;
}

/// The line of `a` followed by that of `b`, turned so that the ends nearest to each other meet; empty where they don't
/// run on into each other.
RecycledVector<Eigen::Vector3d> one_line(const FoundTube& a, const FoundTube& b) {
  RecycledVector<Eigen::Vector3d> best;
  double best_gap = kMaxGapRadii * std::min(a.model.radius_m, b.model.radius_m);
  for (const bool a_backwards : {false, true}) {
    for (const bool b_backwards : {false, true}) {
      RecycledVector<Eigen::Vector3d> first = line_of(a, a_backwards);
      RecycledVector<Eigen::Vector3d> second = line_of(b, b_backwards);
      // The last points of a piece carry the noise of its end: the direction is that of its last two radii.
      const Eigen::Vector3d out = (first.back() - first[first.size() - 3]).normalized();
      // Either may have been followed a little way into the other.
      for (int i = 0; i < kMaxOverlap && second.size() > 3 && (second.front() - first.back()).dot(out) <= 0.0; ++i) {
        second.erase(second.begin());
      }
      const Eigen::Vector3d gap = second.front() - first.back();
      const Eigen::Vector3d in = (second[2] - second.front()).normalized();
      const double length = gap.norm();
      const bool smooth =
          out.dot(gap) > kCos35 * length && in.dot(gap) > kCos35 * length && out.dot(in) > kCos35 * kCos35;
      if (!smooth || length >= best_gap) continue;
      best_gap = length;
      first.insert(first.end(), second.begin(), second.end());
      best = std::move(first);
    }
  }
  return best;
}

/// Where the radius varies, at the two of their ends where it differs least.
double radius_difference_m(const FoundTube& a, const FoundTube& b) {
  double least = std::numeric_limits<double>::infinity();
  for (const double t : {a.extent.t_begin, a.extent.t_end}) {
    for (const double s : {b.extent.t_begin, b.extent.t_end})
      least = std::min(least, std::abs(radius_at(a.model, t) - radius_at(b.model, s)));
  }
  return least;
}

/// Alike but for noise and so much of the radius.
bool like_radii(const FoundTube& a, const FoundTube& b, double part) {
  const double sigma = std::hypot(a.quality.radius_sigma_m, b.quality.radius_sigma_m);
  return radius_difference_m(a, b) < 4.0 * sigma + part * a.model.radius_m;
}

/// Does the camera look through where the tube should be, or see something flat there?
bool refuted(const RecycledVector<Station>& stations, const Extent& extent) {
  int against = 0;
  for (const Station& station : stations) {
    if (station.t > extent.t_begin && station.t < extent.t_end && station.refuted()) ++against;
  }
  return against > 2;
}

}  // namespace

bool run_on(const FoundTube& a, const FoundTube& b) {
  return !a.held_radius_m && !b.held_radius_m && like_radii(a, b, 0.04) && !one_line(a, b).empty();
}

std::optional<FoundTube> join_pieces(const HeightMap& map, const TrackerConfig& config, const FoundTube& a,
                                     const FoundTube& b) {
  if (a.held_radius_m || b.held_radius_m || !like_radii(a, b, 0.04)) return std::nullopt;
  const RecycledVector<Eigen::Vector3d> line = one_line(a, b);
  if (line.empty()) return std::nullopt;
  const bool a_longer = a.evidence.length_m > b.evidence.length_m;
  FoundTube joined;
  joined.model = {spline_along(line, kKnotSpacingRadii * a.model.radius_m),
                  a_longer ? a.model.radius_m : b.model.radius_m};
  FitOptions options;
  options.radius_m = config.radius_m;
  options.varying_radius = config.varying_radius;
  options.radius_min_m = 0.5 * config.radius_min_m;
  options.radius_max_m = 1.5 * config.radius_max_m;
  const Extent all{1.0 - 1e-9, joined.model.spline.spans() - 1.0 + 1e-9};
  for (const double gate_radii : {0.3, 0.2, 0.1}) {
    const auto pixels = predict_pixels(map, config.noise, joined.model);
    const auto observations =
        select_observations(map, config.noise, pixels, gate_radii * joined.model.radius_m, 4.0, all);
    auto quality = fit_tube(joined.model, observations, options);
    if (!quality) return std::nullopt;
    joined.quality = std::move(*quality);
  }
  // What pulls a joined fit away from a piece's radius, like the flank of a tube that it touches, is not this tube.
  if (!like_radii(joined, a, 0.02) || !like_radii(joined, b, 0.02)) return std::nullopt;
  joined.extent = all;
  joined.joined = true;
  joined.pixels = predict_pixels(map, config.noise, joined.model);
  const auto stations = stations_of(map, joined.model, joined.pixels, station_length_m(map, joined.model));
  if (refuted(stations, joined.extent)) return std::nullopt;
  joined.evidence = gather_evidence(map, config.noise, joined.model, joined.pixels, joined.extent);
  const double worst = std::max(a.evidence.noise_ratio, b.evidence.noise_ratio);
  if (joined.evidence.noise_ratio > 1.05 * worst + 0.02) return std::nullopt;
  if (why_no_tube(joined.evidence, joined.model.radius_m, config)) return std::nullopt;
  return joined;
}

bool same_tube(const TubeModel& a, const Extent& a_extent, const TubeModel& b, const Extent& b_extent) {
  constexpr int kSamples = 20;
  // The line lies between its control points: what is away from them all is away from it. Most tubes are.
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& control : b.spline.control_m) box.extend(control);
  const double reach_m = 0.7 * b.radius_m + 1e-6;
  box = {box.min().array() - reach_m, box.max().array() + reach_m};
  int inside = 0;
  for (int i = 0; i < kSamples; ++i) {
    const double t = a_extent.t_begin + (a_extent.t_end - a_extent.t_begin) * (i + 0.5) / kSamples;
    const Eigen::Vector3d point = point_at(a.spline, t);
    if (!box.contains(point)) continue;
    for (double s = b_extent.t_begin; s <= b_extent.t_end; s += 0.25) {
      if ((point - point_at(b.spline, s)).norm() < 0.7 * b.radius_m) {
        ++inside;
        break;
      }
    }
  }
  return 2 * inside > kSamples;
}

}  // namespace tubetrack
