#include "tubetrack/tracker/follow.hpp"

#include <algorithm>
#include <cmath>

#include "followed_extent.hpp"
#include "motion.hpp"
#include "pool.hpp"

namespace tubetrack {

namespace {

constexpr double kRestChi2 = 30.0;      // 6 degrees of freedom: once in 25,000 frames by chance
constexpr int kFramesToComeToRest = 6;  // long enough for 1 mm/s to show
constexpr double kEndTrim = 0.6;        // spans

FitOptions fit_options(const TrackerConfig& config, const FollowedTube& tube, const Information* prior) {
  FitOptions options;
  options.radius_m = config.radius_m ? config.radius_m : tube.held_radius_m;
  options.radius_min_m = 0.5 * config.radius_min_m;
  options.radius_max_m = 1.5 * config.radius_max_m;
  options.prior = prior;
  return options;
}

double inverse(double value) {
  return value > 0.0 ? 1.0 / value : 0.0;
}

/// Observations of the stretch that is known, short of its ends: what lies there may be the end's own face, or what it
/// touches. A short piece gives up a tenth at either end.
std::vector<Observation> observe(const HeightMap& map, const TrackerConfig& config, const FollowedTube& tube,
                                 const std::vector<PredictedPixel>& pixels, double gate_m) {
  auto observations = select_observations(map, config.noise, pixels, gate_m, 4.0);
  const double trim = std::min(kEndTrim, 0.1 * (tube.extent.t_end - tube.extent.t_begin));
  std::erase_if(observations, [&](const Observation& observation) {
    return observation.t < tube.extent.t_begin + trim || observation.t > tube.extent.t_end - trim;
  });
  return observations;
}

/// The motion from where a model is to where the observations are; `enough` false: too few to tell.
struct Placed {
  MotionEstimate estimate;
  bool enough = false;
};
Placed place(const HeightMap& map, const TrackerConfig& config, const FollowedTube& tube, const TubeModel& model,
             double gate_radii) {
  const auto pixels = predict_pixels(map, config.noise, model);
  const auto observations = observe(map, config, tube, pixels, gate_radii * model.radius_m);
  const NormalEquations eq = normal_equations(model, observations, fit_options(config, tube, nullptr));
  if (eq.used < 20) return {};
  return {estimate_motion(model, eq.observed, eq.observed_right, tube.radius_information), true};
}

/// Goes over from rest to motion and back. `model` starts where the tube is expected and ends where the frame sees it.
bool judge_motion(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel& model,
                  double elapsed_s) {
  const Placed first = place(map, config, tube, model, 0.5);
  if (!first.enough) return false;
  if (tube.at_rest) {
    if (motion_chi2(model, first.estimate, tube.pooled.matrix) < kRestChi2) return true;
    tube.at_rest = false;
    tube.frames_pooled = 0;
    tube.anchor = tube.model;
  }
  move(model, first.estimate.twist);
  const Placed second = place(map, config, tube, model, 0.25);
  if (!second.enough) return false;
  move(model, second.estimate.twist);
  const Twist change{first.estimate.twist.shift_m + second.estimate.twist.shift_m,
                     first.estimate.twist.turn_rad + second.estimate.twist.turn_rad};
  if (elapsed_s > 0.0) {
    tube.velocity.shift_m_s += 0.6 * change.shift_m / elapsed_s;
    tube.velocity.turn_rad_s += 0.6 * change.turn_rad / elapsed_s;
  }
  return true;
}

/// Moving: every few frames, asks whether the tube is still where it was a few frames ago.
void judge_rest(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  if (++tube.frames_pooled < kFramesToComeToRest) return;
  tube.frames_pooled = 0;
  const Placed back = place(map, config, tube, tube.anchor, 0.5);
  if (back.enough && motion_chi2(tube.anchor, back.estimate, tube.quality.observed.matrix) < kRestChi2) {
    start_pool(tube);
    add_to_pool(tube);
    return;
  }
  tube.anchor = tube.model;
}

bool fit_to_frame(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel model,
                  const Information& prior) {
  const double radius_sigma_m = tube.quality.radius_sigma_m;
  for (const double gate_radii : {0.2, 0.1}) {
    tube.pixels = predict_pixels(map, config.noise, model);
    const auto observations = observe(map, config, tube, tube.pixels, gate_radii * model.radius_m);
    FitOptions options = fit_options(config, tube, &prior);
    options.gauss_newton_steps = 1;
    options.want_covariance = gate_radii < 0.15;
    auto quality = fit_tube(model, observations, options);
    if (!quality) return false;
    tube.quality = std::move(*quality);
  }
  tube.model = std::move(model);
  if (tube.held_radius_m) {
    tube.quality.radius_sigma_m = radius_sigma_m;
  } else if (!config.radius_m) {
    // The radius may be known no better than to a few parts in ten thousand: no tube is rounder.
    const double floor_m = 3e-4 * tube.model.radius_m;
    tube.quality.radius_sigma_m = std::hypot(tube.quality.radius_sigma_m, floor_m);
    tube.radius_information = inverse(tube.quality.radius_sigma_m * tube.quality.radius_sigma_m);
  }
  return true;
}

/// Pixels and stations of the present model, and what they say of its extent, support and state.
void look(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  tube.pixels = predict_pixels(map, config.noise, tube.model);
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

/// Goes on along what the image confirms until there is no more, or none without a bend that no tube has.
void lengthen(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  constexpr int kMaxRounds = 40;
  int stalled = 0;
  for (int round = 0; round < kMaxRounds && stalled < 3; ++round) {
    FollowedTube longer = tube;
    fit_spline_to_extent(longer);
    if (!fit_to_frame(longer, map, config, longer.model, no_information(longer.model))) return;
    look(longer, map, config);
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

void pool_first_frame(FollowedTube& tube) {
  tube.radius_information = inverse(tube.quality.radius_sigma_m * tube.quality.radius_sigma_m);
  start_pool(tube);
  tube.pooled = no_information(tube.model);  // the radius is in what was observed
  add_to_pool(tube);
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
  tube.pixels = std::move(found.pixels);
  tube.stations = stations_of(map, tube.model, tube.pixels, station_length_m(map, tube.model));
  // A little more at an end may be the foot of a can or the table that it stands on; much more is tube.
  FollowedTube longer = tube;
  lengthen(longer, map, config);
  if (found.joined || length_m(longer) - length_m(tube) > 2.0 * tube.model.radius_m) tube = std::move(longer);
  tube.last_seen_s = timestamp_s;
  pool_first_frame(tube);
  return tube;
}

void pool_without_ends(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  if (length_m(tube) <= 8.0 * tube.model.radius_m) return;
  FollowedTube without = tube;
  if (!fit_to_frame(without, map, config, tube.model, no_information(tube.model))) return;
  tube.quality.observed = std::move(without.quality.observed);
  pool_first_frame(tube);
}

void follow_tube(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, double timestamp_s,
                 double elapsed_s) {
  fit_spline_to_extent(tube);
  if (tube.at_rest) creep_on(tube, elapsed_s);
  TubeModel expected = tube.model;
  if (!tube.at_rest) move(expected, during(tube.velocity, elapsed_s));
  const FollowedTube before = tube;
  TubeModel model = expected;
  const bool placed = judge_motion(tube, map, config, model, elapsed_s);
  const bool fitted =
      placed && fit_to_frame(tube, map, config, std::move(model), tube.at_rest ? tube.pooled : radius_only(tube));
  if (!fitted) tube.model = expected;
  look(tube, map, config);
  if (!fitted && tube.state == TubeState::tracked) tube.state = TubeState::lost;
  if (tube.state != TubeState::tracked) {
    const TubeState state = tube.state;
    auto pixels = std::move(tube.pixels);
    auto stations = std::move(tube.stations);
    tube = before;
    tube.model = std::move(expected);
    tube.state = state;
    tube.pixels = std::move(pixels);
    tube.stations = std::move(stations);
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
}

}  // namespace tubetrack
