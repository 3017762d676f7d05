#include "tubetrack/tracker/follow.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "confidence.hpp"
#include "fit_steps.hpp"
#include "followed_extent.hpp"
#include "line_ends.hpp"
#include "motion.hpp"
#include "observe.hpp"
#include "pool.hpp"

namespace tubetrack {

namespace {

constexpr double kRestChi2 = 30.0;      // 6 degrees of freedom: once in 25,000 frames by chance
constexpr int kFramesToComeToRest = 6;  // long enough for 1 mm/s to show
constexpr double kHook = 1.0;           // spans at an end that may be bent
constexpr double kEndTrim = 0.6;        // spans
constexpr double kRoundness = 3e-4;
constexpr double kFitGate = 0.1;  // radii: how near a reading must be to be fitted, beside its noise
// Radii: so little a placing may still move for the fit to take it along. At four times as much a tube that leaves and
// comes back is lost now and then.
constexpr double kSettled = 0.005;
constexpr double kStale = 0.02;  // radii: so far a model may have moved from the one whose pixels were predicted
// Radii: so little, and at rest the last frame's pixels are taken again. It is a fifth of a pixel's noise or less.
constexpr double kUnmoved = 0.005;

FitOptions fit_options(const TrackerConfig& config, const FollowedTube& tube, const Information* prior) {
  FitOptions options;
  options.radius_m = config.radius_m ? config.radius_m : tube.held_radius_m;
  options.varying_radius = config.varying_radius;
  options.radius_min_m = 0.5 * config.radius_min_m;
  options.radius_max_m = 1.5 * config.radius_max_m;
  options.prior = prior;
  return options;
}

double inverse(double value) {
  return value > 0.0 ? 1.0 / value : 0.0;
}

void predict(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, const TubeModel& model) {
  predict_pixels(map, config.noise, model, 1, tube.pixels);
  tube.predicted = model;
}

/// What the frame says of a model whose pixels the tube has: those near it, which are fitted, and all about it, by
/// which it is found again.
struct View {
  ObservedEquations near, all;
  SortedObservations readings;  ///< those near it, where the radius may vary
};

/// Of the stretch that is known, short of its ends: what lies there may be the end's own face, or what it touches. A
/// short piece gives up a tenth at either end.
View view_of(const FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, const TubeModel& model,
             double near_radii, double far_radii) {
  const double trim = std::min(kEndTrim, 0.1 * (tube.extent.t_end - tube.extent.t_begin));
  const Gates gates{near_radii * model.radius_m, far_radii * model.radius_m, 4.0};
  thread_local Sighting sighting;  // for its buffers
  observe(map, config.noise, model.spline, tube.pixels, gates, {tube.extent.t_begin + trim, tube.extent.t_end - trim},
          sighting);
  const bool free_radius = !fit_options(config, tube, nullptr).radius_m;
  View view{observed_equations(model, sighting.near, free_radius), {}, {}};
  if (config.varying_radius) view.readings = sighting.near;
  if (far_radii <= near_radii) return view;
  view.all = observed_equations(model, sighting.far, free_radius);
  view.all += view.near;
  return view;
}

/// The motion from where a model is to where the frame sees it; empty where it sees too little to tell.
std::optional<MotionEstimate> motion_seen(const FollowedTube& tube, const TubeModel& model, const View& view) {
  if (view.all.used < 20) return std::nullopt;
  return estimate_motion(model, view.all.matrix, view.all.right, tube.radius_information);
}

/// How far a step took what is in sight.
double moved_m(const TubeModel& from, const TubeModel& to, const Extent& extent) {
  constexpr double kSteps = 16;
  double farthest = 0.0;
  for (double i = 0; i <= kSteps; ++i) {
    const double t = extent.t_begin + (extent.t_end - extent.t_begin) * i / kSteps;
    farthest = std::max({farthest, std::abs(radius_at(to, t) - radius_at(from, t)),
                         (point_at(to.spline, t) - point_at(from.spline, t)).norm()});
  }
  return farthest;
}

/// Are the tube's pixels, along what is in sight, nearly those of a model?
bool has_pixels_of(const FollowedTube& tube, const TubeModel& model) {
  const TubeModel& of = tube.predicted;
  const bool same_spans = of.spline.control_m.size() == model.spline.control_m.size() &&
                          of.spline.first_span == model.spline.first_span;
  const bool one_radius = of.profile.offset_m.empty() && model.profile.offset_m.empty();
  return same_spans && one_radius && moved_m(of, model, tube.extent) <= kUnmoved * model.radius_m;
}

/// Goes over from rest to motion and back. `model` starts where the tube is expected and ends where the frame sees it,
/// or so near that one step of the fit goes there, with its pixels predicted and what the frame says of it in `view`.
bool judge_motion(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel& model,
                  double elapsed_s, View& view) {
  if (!tube.at_rest || !has_pixels_of(tube, model)) predict(tube, map, config, model);
  view = view_of(tube, map, config, model, kFitGate, 0.5);
  const auto first = motion_seen(tube, model, view);
  if (!first) return false;
  if (tube.at_rest) {
    if (motion_chi2(model, *first, tube.pooled.matrix) < kRestChi2) return true;
    tube.at_rest = false;
    tube.frames_pooled = 0;
    tube.anchor = tube.model;
  }
  move(model, first->twist);
  predict(tube, map, config, model);
  view = view_of(tube, map, config, model, kFitGate, 0.25);
  const auto second = motion_seen(tube, model, view);
  if (!second) return false;
  if (elapsed_s > 0.0) {
    tube.velocity.shift_m_s += 0.6 * (first->twist.shift_m + second->twist.shift_m) / elapsed_s;
    tube.velocity.turn_rad_s += 0.6 * (first->twist.turn_rad + second->twist.turn_rad) / elapsed_s;
  }
  TubeModel moved = model;
  move(moved, second->twist);
  if (moved_m(model, moved, tube.extent) <= kSettled * model.radius_m) return true;
  model = std::move(moved);
  predict(tube, map, config, model);
  view = view_of(tube, map, config, model, kFitGate, kFitGate);
  return true;
}

/// Moving: every few frames, asks whether the tube is still where it was a few frames ago.
void judge_rest(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  if (++tube.frames_pooled < kFramesToComeToRest) return;
  tube.frames_pooled = 0;
  auto pixels = std::exchange(tube.pixels, {});
  auto predicted = std::exchange(tube.predicted, {});
  predict(tube, map, config, tube.anchor);
  const auto back = motion_seen(tube, tube.anchor, view_of(tube, map, config, tube.anchor, kFitGate, 0.5));
  tube.pixels = std::move(pixels);
  tube.predicted = std::move(predicted);
  if (back && motion_chi2(tube.anchor, *back, tube.quality.observed.matrix) < kRestChi2) {
    start_pool(tube);
    add_to_pool(tube);
    return;
  }
  tube.anchor = tube.model;
}

/// One step from a model that is near.
bool fit_once(FollowedTube& tube, const TrackerConfig& config, TubeModel& model, View view, const Information& prior,
              const ProfileInformation* profile_prior, bool want_covariance) {
  FitOptions options = fit_options(config, tube, &prior);
  options.want_covariance = want_covariance;
  options.profile_prior = profile_prior;
  options.prior_has_places = tube.at_rest;
  options.gauss_newton_steps = 1;
  auto quality = options.varying_radius && !options.radius_m ? fit_tube(model, view.readings, options)
                                                             : take_step(model, std::move(view.near), options);
  if (!quality) return false;
  const double radius_sigma_m = tube.quality.radius_sigma_m;
  tube.quality = std::move(*quality);
  if (tube.held_radius_m) tube.quality.radius_sigma_m = radius_sigma_m;
  return true;
}

void take_model(FollowedTube& tube, TubeModel model, const TrackerConfig& config) {
  tube.model = std::move(model);
  if (tube.held_radius_m || config.radius_m) return;
  // The radius may be known no better than to a few parts in ten thousand: no tube is rounder.
  tube.quality.radius_sigma_m = std::hypot(tube.quality.radius_sigma_m, kRoundness * tube.model.radius_m);
  tube.radius_information = inverse(tube.quality.radius_sigma_m * tube.quality.radius_sigma_m);
}

/// Two steps, for a model that may be farther off.
bool fit_to_frame(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel model) {
  const Information nothing = no_information(model);
  predict(tube, map, config, model);
  if (!fit_once(tube, config, model, view_of(tube, map, config, model, 0.2, 0.2), nothing, nullptr, false))
    return false;
  predict(tube, map, config, model);
  if (!fit_once(tube, config, model, view_of(tube, map, config, model, kFitGate, kFitGate), nothing, nullptr, true))
    return false;
  take_model(tube, std::move(model), config);
  return true;
}

/// What the tube's pixels, which are predicted, say of its stations, extent, support and state.
void look(FollowedTube& tube, const HeightMap& map) {
  const double station_m = station_length_m(map, tube.model);
  tube.stations = stations_of(map, tube.model, tube.pixels, station_m);
  const Extent extent = confirmed_extent(tube.stations, tube.extent);
  int agree = 0, expected = 0, seen = 0, unknown = 0, all = 0;
  for (const Station& station : tube.stations) {
    if (station.t < extent.t_begin || station.t > extent.t_end) continue;
    ++all;
    unknown += hidden(station) ? 1 : 0;
    if (!agrees(station)) continue;
    ++seen;
    agree += station.agree;
    expected += station.expected;
  }
  tube.support = expected > 0 ? static_cast<double>(agree) / expected : 0.0;
  const bool enough = seen * station_m >= std::max(tube.model.radius_m, 0.010) && tube.support > 0.7;
  if (enough) tube.extent = extent;
  tube.state = enough ? TubeState::tracked : 2 * unknown > all && all > 0 ? TubeState::occluded : TubeState::lost;
}

/// Goes on along what the image confirms until so many rounds brought nothing more, or none without a bend that no tube
/// has.
void lengthen(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, int patience) {
  constexpr int kMaxRounds = 40;
  int stalled = 0;
  for (int round = 0; round < kMaxRounds && stalled < patience; ++round) {
    FollowedTube longer = tube;
    fit_spline_to_extent(longer);
    if (!fit_to_frame(longer, map, config, longer.model)) return;
    predict(longer, map, config, longer.model);
    look(longer, map);
    if (longer.state != TubeState::tracked) return;
    if (min_bend_radii(longer.model, longer.extent) < config.min_bend_radii) return;
    const double gain = (longer.extent.t_end - longer.extent.t_begin) - (tube.extent.t_end - tube.extent.t_begin);
    tube = std::move(longer);
    stalled = gain < 0.3 ? stalled + 1 : 0;
  }
}

double length_m(const FollowedTube& tube) {
  return (tube.extent.t_end - tube.extent.t_begin) * kKnotSpacingRadii * tube.model.radius_m;
}

/// Is one of its ends turned toward the camera? Its face, fitted as the tube's surface, bends the centreline there.
bool shows_a_face(const FollowedTube& tube) {
  constexpr double kTurned = 0.25;  // cosine
  const auto toward_camera = [&](double t, double outward) {
    const Eigen::Vector3d direction = outward * derivative_at(tube.model.spline, t).normalized();
    return -direction.dot(point_at(tube.model.spline, t).normalized());
  };
  // Two spans inside, where the face has bent nothing yet.
  constexpr double kInside = 2.0;
  return toward_camera(tube.extent.t_begin + kInside, -1.0) > kTurned ||
         toward_camera(tube.extent.t_end - kInside, 1.0) > kTurned;
}

void pool_first_frame(FollowedTube& tube) {
  tube.radius_information = inverse(tube.quality.radius_sigma_m * tube.quality.radius_sigma_m);
  start_pool(tube);
  tube.pooled = no_information(tube.model);  // the radius is in what was observed
  add_to_pool(tube);
  tube.profile_pool = {};
  add_to_profile_pool(tube);
}

/// The tube as it is before a frame, but for what that replaces or leaves alone in any case, which is large.
FollowedTube set_aside(FollowedTube& tube) {
  auto pixels = std::move(tube.pixels);
  auto stations = std::move(tube.stations);
  auto pooled = std::move(tube.pooled);
  auto quality = std::exchange(tube.quality, {});
  tube.quality.radius_sigma_m = quality.radius_sigma_m;
  FollowedTube before = tube;
  before.quality = std::move(quality);
  tube.pixels = std::move(pixels);
  tube.stations = std::move(stations);
  tube.pooled = std::move(pooled);
  return before;
}

/// Not seen where it is expected: it stays as it was before this frame, but there.
void keep_expected(FollowedTube& tube, FollowedTube before, TubeModel expected) {
  before.model = std::move(expected);
  before.state = tube.state;
  before.pixels = std::move(tube.pixels);
  before.predicted = std::move(tube.predicted);
  before.stations = std::move(tube.stations);
  before.pooled = std::move(tube.pooled);
  tube = std::move(before);
}

}  // namespace

FollowedTube start_following(FoundTube found, const HeightMap& map, const TrackerConfig& config, double timestamp_s,
                             std::int64_t id) {
  FollowedTube tube;
  tube.id = id;
  tube.model = std::move(found.model);
  tube.extent = found.extent;
  tube.held_radius_m = found.held_radius_m;
  tube.quality = std::move(found.quality);
  tube.support = found.evidence.support;
  add_look(tube, found.evidence);
  tube.pixels = std::move(found.pixels);
  tube.predicted = tube.model;
  tube.stations = stations_of(map, tube.model, tube.pixels, station_length_m(map, tube.model));
  // A little more at an end may be the foot of a can or the table that it stands on; much more is tube.
  FollowedTube longer = tube;
  lengthen(longer, map, config, found.joined ? 3 : 1);
  if (found.joined || length_m(longer) - length_m(tube) > 2.0 * tube.model.radius_m) tube = std::move(longer);
  tube.last_seen_s = timestamp_s;
  pool_first_frame(tube);
  return tube;
}

void pool_without_ends(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  if (length_m(tube) <= 8.0 * tube.model.radius_m) return;
  FollowedTube without = tube;
  // From ends that were bent into hooks the prior, which takes large bends for granted, would not come back.
  TubeModel start = tube.model;
  continue_from(start.spline, tube.extent.t_begin + kHook, tube.extent.t_end - kHook);
  if (!fit_to_frame(without, map, config, std::move(start))) return;
  // Where the ends tell much of the radius, that they bend the line costs less than leaving them out.
  const bool costs_little = without.quality.radius_sigma_m <= 1.1 * tube.quality.radius_sigma_m;
  if (costs_little && shows_a_face(tube)) {
    tube.model = std::move(without.model);
    tube.quality = std::move(without.quality);
    pool_first_frame(tube);
    return;
  }
  tube.quality.observed = std::move(without.quality.observed);
  tube.quality.profile = std::move(without.quality.profile);
  if (!tube.model.profile.offset_m.empty()) {
    tube.model.radius_m = without.model.radius_m;
    tube.model.profile = std::move(without.model.profile);
  }
  pool_first_frame(tube);
}

void follow_tube(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, double timestamp_s,
                 double elapsed_s) {
  fit_spline_to_extent(tube);
  if (tube.at_rest) creep_on(tube, elapsed_s);
  TubeModel expected = tube.model;
  if (!tube.at_rest) move(expected, during(tube.velocity, elapsed_s));
  FollowedTube before = set_aside(tube);
  TubeModel model = expected;
  View view;
  bool fitted = judge_motion(tube, map, config, model, elapsed_s, view);
  if (fitted) {
    fitted = fit_once(tube, config, model, std::move(view), tube.at_rest ? tube.pooled : radius_only(tube),
                      tube.at_rest ? &tube.profile_pool : nullptr, true);
    if (fitted) take_model(tube, std::move(model), config);
    if (fitted && moved_m(tube.predicted, tube.model, tube.extent) > kStale * tube.model.radius_m)
      predict(tube, map, config, tube.model);
  }
  if (!fitted) {
    tube.model = expected;
    predict(tube, map, config, expected);
  }
  look(tube, map);
  if (!fitted && tube.state == TubeState::tracked) tube.state = TubeState::lost;
  if (tube.state != TubeState::tracked) {
    keep_expected(tube, std::move(before), std::move(expected));
    return;
  }
  tube.last_seen_s = timestamp_s;
  ++tube.frames_followed;
  if (tube.at_rest) {
    add_to_pool(tube);
    judge_creep(tube);
  } else {
    judge_rest(tube, map, config);
  }
  add_to_profile_pool(tube);
}

}  // namespace tubetrack
