#include "tubetrack/tracker/grow.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "fit_steps.hpp"
#include "line_ends.hpp"
#include "motion.hpp"
#include "observe.hpp"
#include "shape_sums.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "why_no_tube.hpp"

namespace tubetrack {

namespace {

constexpr int kHiddenSpans = 12;    // behind something nearer a tube may go on so far
constexpr double kLongLine = 12.0;  // radii: no body of a vessel

double spacing_m(const Spline& spline) {
  return (spline.control_m[2] - spline.control_m[1]).norm();
}

double length_of(const FoundTube& found) {
  return (found.extent.t_end - found.extent.t_begin) * spacing_m(found.model.spline);
}

constexpr double kTightest = 1.5;  // radii: a tube bends no tighter

/// Of each span, do its control points alone tell that the line bends less than `kTightest` there? The derivative is
/// within `bend` of the middle step; what it turns by over a short stretch, and how long that is, follow from both.
RecycledVector<bool> gentle_spans(const TubeModel& model) {
  const auto& q = model.spline.control_m;
  RecycledVector<bool> gentle;
  for (std::size_t k = 0; k + 3 < q.size(); ++k) {
    const Eigen::Vector3d step = q[k + 2] - q[k + 1];
    const double bend = std::max((step - (q[k + 1] - q[k])).norm(), (q[k + 3] - q[k + 2] - step).norm());
    const double least = step.norm() - bend;
    // An angle is at most 1.05 times its sine up to 60° of turn.
    gentle.push_back(bend < 2.0 * least && 1.1 * kTightest * model.radius_m * bend < least * (least - 0.125 * bend));
  }
  return gentle;
}

/// Cuts the extent where the centreline bends tighter than a tube can, seen from its middle.
void cut_at_kinks(const TubeModel& model, Extent& extent) {
  constexpr double kStep = 0.25;
  const RecycledVector<bool> gentle = gentle_spans(model);
  const auto is_gentle = [&](double t) {
    return gentle[static_cast<std::size_t>(std::clamp(static_cast<int>(t), 0, static_cast<int>(gentle.size()) - 1))];
  };
  const double middle = 0.5 * (extent.t_begin + extent.t_end);
  const auto kinked = [&](double t) {
    if (is_gentle(t - kStep) && is_gentle(t + kStep)) return false;
    const Eigen::Vector3d before = derivative_at(model.spline, t - kStep);
    const Eigen::Vector3d after = derivative_at(model.spline, t + kStep);
    const double turn = std::atan2(before.cross(after).norm(), before.dot(after));
    const double length = (point_at(model.spline, t + kStep) - point_at(model.spline, t - kStep)).norm();
    return turn * kTightest * model.radius_m > length;
  };
  for (double t = middle; t < extent.t_end; t += 0.125) {
    if (kinked(t)) extent.t_end = t;
  }
  for (double t = middle; t > extent.t_begin; t -= 0.125) {
    if (kinked(t)) extent.t_begin = t;
  }
}

/// Cuts off what of the spline is not confirmed.
void cut_to(Spline& spline, const Extent& extent) {
  auto& q = spline.control_m;
  const double back_spare = spline.spans() - extent.t_end;
  for (int i = 0; i <= static_cast<int>(back_spare) && q.size() > 5; ++i) q.pop_back();
  for (int i = 0; i <= static_cast<int>(extent.t_begin) && q.size() > 5; ++i) {
    q.erase(q.begin());
    ++spline.first_span;
  }
}

/// Goes straight on beyond what is confirmed, one to two spans: a bend that the fit carried past the confirmed part
/// must not hide where the tube goes on.
void reach_beyond(Spline& spline, const Extent& extent) {
  cut_to(spline, extent);
  extend(spline, true, true);
  extend(spline, true, true);
}

/// The radius that both silhouettes ask for, where they contradict the surface's curvature, which sensors that smooth
/// over several pixels flatten; half a pixel is what an edge loses on average. Empty where they agree or are not seen,
/// or one of them contradicts much more than the other: then the axis lies aside, and nothing is smoothed. Nor where
/// noise alone may bring the curvature so far, as on a short piece of a thin tube.
std::optional<double> silhouette_radius_m(const Evidence& e, double radius_m) {
  constexpr double kAlike = 0.16;  // radii
  if (!e.left.ends || !e.right.ends) return std::nullopt;
  if (std::abs(e.left.reach_radii - e.right.reach_radii) > kAlike) return std::nullopt;
  const double half_pixel = 1.0 / e.width_px;
  const double reach = 0.5 * (e.left.reach_radii + e.right.reach_radii) + half_pixel;
  if (reach < 0.65 || reach + half_pixel > 0.87 || 1.0 - reach < 3.0 * e.flatness_sigma) return std::nullopt;
  return reach * radius_m;
}

/// What the predicted pixels say of the stations, and how far along it the image confirms the model, across gaps so
/// wide.
RecycledVector<Station> judge_extent(const HeightMap& map, int stride, double max_gap_radii, FoundTube& found) {
  const double station_m = stride * station_length_m(map, found.model);
  auto stations = stations_of(map, found.model, found.pixels, station_m);
  found.extent = seen_extent(stations, station_m, max_gap_radii * found.model.radius_m);
  cut_at_kinks(found.model, found.extent);
  return stations;
}

/// The same for the present model, whose pixels are predicted.
RecycledVector<Station> look(const HeightMap& map, const TrackerConfig& config, int stride, double max_gap_radii,
                             FoundTube& found) {
  predict_pixels(map, config.noise, found.model, stride, found.pixels);
  return judge_extent(map, stride, max_gap_radii, found);
}

/// How long it is grown: until its length stays, in more rounds than the first and at most the second number.
struct Rounds {
  int before_settled = 4;
  int at_most = 40;
  double max_gap_radii = 4.0;  ///< hidden stretches that it may cross
  double suppleness = 1.0;
  /// What it was found to be before: it is settled then as soon as a fit hardly moves it. Not what grows from a seed:
  /// an end that is seen little, behind a gap, comes to its place by small steps.
  double length_m = 0.0;
};

/// Looks how far the image confirms the tube, fits to that part alone, lengthens or shortens it, until it stays. What
/// is not confirmed yet (the table under a can, its lid) must not pull at the fit. `pixels`: the model's, where they
/// are predicted already.
std::optional<FoundTube> grow_until_settled(const HeightMap& map, const TrackerConfig& config, TubeModel model,
                                            int stride, const Rounds& rounds, const PredictedPixels* pixels = nullptr) {
  constexpr double kCalm = 0.01;  // radii, below the noise of a fit
  constexpr double kSure = 0.02;
  constexpr double kLeap = 0.5;  // radii: what the image confirms does not move so far
  constexpr int kMaxLeaps = 2;
  constexpr int kMaxSwings = 4;  // a tube that was followed too far comes back once
  FoundTube found;
  found.model = std::move(model);
  FitOptions options;
  options.radius_m = config.radius_m;
  options.varying_radius = config.varying_radius;
  options.radius_min_m = 0.5 * config.radius_min_m;
  options.radius_max_m = 1.5 * config.radius_max_m;
  RecycledVector<Station> stations;
  thread_local Sighting sighting;  // for its buffers
  if (pixels) {
    found.pixels = *pixels;
    judge_extent(map, stride, rounds.max_gap_radii, found);
  } else {
    look(map, config, stride, rounds.max_gap_radii, found);
  }
  double length_before_m = rounds.length_m;
  int swings = 0, leaps = 0;
  for (int round = 0; round < rounds.at_most; ++round) {
    if (found.extent.t_end <= found.extent.t_begin) return std::nullopt;
    const double gate_m = (round == 0 ? 0.2 : 0.1) * found.model.radius_m;
    observe(map, config.noise, found.model.spline, found.pixels, {gate_m, gate_m, 4.0}, found.extent, sighting);
    // A short piece can't tell a bend from what lies beside it.
    const double confirmed_m = length_of(found);
    options.suppleness = confirmed_m < 4.0 * found.model.radius_m ? 0.05 : rounds.suppleness;
    options.want_covariance = stride == 1 && (round > 0 || rounds.length_m > 0.0);  // may be the last
    const TubeModel before = found.model;
    const Extent fitted = found.extent;
    auto quality = fit_tube(found.model, sighting.near, options);
    if (!quality) return std::nullopt;
    found.quality = std::move(*quality);
    stations = look(map, config, stride, rounds.max_gap_radii, found);
    const double length_m = length_of(found);
    const double radius_m = found.model.radius_m;
    const double moved = moved_m(before, found.model, fitted) / radius_m;
    if (round > 0 && moved > kLeap && ++leaps == kMaxLeaps) return std::nullopt;
    if (round > 3 && length_m < length_before_m - radius_m && ++swings == kMaxSwings) return std::nullopt;
    const bool settled = std::abs(length_m - length_before_m) < 0.1 * radius_m;
    // What is long and seen well is at its place at once; what is hidden in part comes there by small steps.
    const bool sure =
        round > 0 && moved < kSure && length_m > kLongLine * radius_m && is_well_seen(stations, found.extent);
    const bool calm = sure || (rounds.length_m > 0.0 && moved < kCalm);
    if ((settled && (round >= rounds.before_settled || calm)) || round + 1 == rounds.at_most) break;
    length_before_m = length_m;
    reach_beyond(found.model.spline, found.extent);
    if (spacing_m(found.model.spline) < 1e-4) return std::nullopt;
    look(map, config, stride, rounds.max_gap_radii, found);
  }
  if (found.extent.t_end <= found.extent.t_begin) return std::nullopt;
  found.evidence = surface_evidence(map, config.noise, found.model, found.pixels, stations, found.extent);
  return found;
}

/// A thick tube has more pixels than growing needs: with every so manieth, twenty are left across it.
int growing_stride(const HeightMap& map, const TubeModel& model) {
  const double depth_m = std::max(point_at(model.spline, 0.5 * model.spline.spans()).z(), 0.05);
  return std::clamp(static_cast<int>(2.0 * model.radius_m * map.intrinsics.fx_px / depth_m / 20.0), 1, 4);
}

/// Grows to the full length with a part of the pixels, where that is worth it, and then with all.
std::optional<FoundTube> grow_model(const HeightMap& map, const TrackerConfig& config, TubeModel model) {
  const int stride = growing_stride(map, model);
  Rounds rounds;
  if (stride > 1) {
    auto coarse = grow_until_settled(map, config, std::move(model), stride, {});
    if (!coarse) return std::nullopt;
    if (hopeless(coarse->evidence, coarse->model.radius_m, config) &&
        !silhouette_radius_m(coarse->evidence, coarse->model.radius_m))
      return std::nullopt;
    rounds = {1, 3};
    model = std::move(coarse->model);
  }
  auto found = grow_until_settled(map, config, std::move(model), 1, rounds);
  if (found && !why_no_surface(found->evidence, found->model.radius_m, config)) {
    look_beside(map, config.noise, found->model, found->extent, found->evidence);
  }
  return found;
}

/// Grows along the traced line where there is one, else from the seed alone.
std::optional<FoundTube> grow_from(const HeightMap& map, const TrackerConfig& config, const TubeModel& start,
                                   const RecycledVector<Eigen::Vector3d>& line_m) {
  if (line_m.size() > 3) {
    TubeModel traced{spline_along(line_m, kKnotSpacingRadii * start.radius_m), start.radius_m};
    auto found = grow_model(map, config, std::move(traced));
    if (found && !why_no_tube(found->evidence, found->model.radius_m, config)) return found;
  }
  return grow_model(map, config, start);
}

/// Notes that the silhouettes say how thick a tube is.
void hold(FoundTube& tube, std::optional<double> radius_m) {
  tube.held_radius_m = radius_m;
  // A twentieth of a pixel: two edges over tens of rows. What they err alike is NoiseModel::radius_relative.
  if (radius_m) tube.quality.radius_sigma_m = 0.1 * *radius_m / tube.evidence.width_px;
}

/// The same with the radius held at what the silhouettes say.
std::optional<FoundTube> grow_held(const HeightMap& map, TrackerConfig config, TubeModel start, double radius_m,
                                   const RecycledVector<Eigen::Vector3d>& line_m) {
  config.radius_m = radius_m;
  start.radius_m = radius_m;
  auto found = grow_from(map, config, start, line_m);
  if (found) hold(*found, radius_m);
  return found;
}

}  // namespace

std::optional<FoundTube> grow_tube(const HeightMap& map, const TrackerConfig& config, const FoundTube& start,
                                   const RecycledVector<Eigen::Vector3d>& line_m) {
  if (config.radius_m) return grow_from(map, config, start.model, line_m);
  if (const auto radius_m = silhouette_radius_m(start.evidence, start.model.radius_m)) {
    return grow_held(map, config, start.model, *radius_m, line_m);
  }
  auto found = grow_from(map, config, start.model, line_m);
  if (!found) return found;
  if (const auto radius_m = silhouette_radius_m(found->evidence, found->model.radius_m)) {
    return grow_held(map, config, found->model, *radius_m, {});
  }
  return found;
}

void go_on_behind(const HeightMap& map, const TrackerConfig& config, FoundTube& tube) {
  TubeModel longer = tube.model;
  cut_to(longer.spline, tube.extent);
  if (!may_go_on(map, config.noise, longer, growing_stride(map, longer))) return;
  for (int i = 0; i < kHiddenSpans; ++i) extend(longer.spline, true, true);
  constexpr double kGapRadii = kHiddenSpans * kKnotSpacingRadii;
  const int stride = growing_stride(map, longer);
  FoundTube ahead;
  ahead.model = longer;
  look(map, config, stride, kGapRadii, ahead);
  const double gain_m = arc_length_m(longer.spline, ahead.extent.t_begin, ahead.extent.t_end) - tube.evidence.length_m;
  if (gain_m < 0.5 * tube.model.radius_m) return;
  TrackerConfig held = config;
  if (tube.held_radius_m) held.radius_m = tube.held_radius_m;
  // Held straight until it is known how far it goes, or the first few pixels beyond bend it.
  FoundTube whole;
  double length_m = 0.0;
  for (const double suppleness : {0.1, 1.0}) {
    const Rounds rounds{1, 8, kGapRadii, suppleness, length_m};
    auto grown = grow_until_settled(map, held, std::move(longer), suppleness < 1.0 ? stride : 1, rounds);
    if (!grown || grown->evidence.length_m < tube.evidence.length_m + 0.5 * tube.model.radius_m) return;
    if (grown->evidence.noise_ratio > 1.25 * tube.evidence.noise_ratio) return;
    whole = std::move(*grown);
    length_m = length_of(whole);
    longer = whole.model;
  }
  look_beside(map, config.noise, whole.model, whole.extent, whole.evidence);
  if (why_no_tube(whole.evidence, whole.model.radius_m, config)) return;
  hold(whole, tube.held_radius_m);
  tube = std::move(whole);
}

void fit_again(const HeightMap& map, const TrackerConfig& config, FoundTube& tube) {
  TrackerConfig held = config;
  if (tube.held_radius_m) held.radius_m = tube.held_radius_m;
  const Rounds rounds{2, 4, kHiddenSpans * kKnotSpacingRadii, 1.0, length_of(tube)};
  auto again = grow_until_settled(map, held, tube.model, 1, rounds, &tube.pixels);
  if (!again || again->evidence.length_m < 0.8 * tube.evidence.length_m) return;
  look_beside(map, config.noise, again->model, again->extent, again->evidence);
  if (why_no_tube(again->evidence, again->model.radius_m, config)) return;
  hold(*again, tube.held_radius_m);
  tube = std::move(*again);
}

}  // namespace tubetrack
