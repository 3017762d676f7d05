#include "frame_fit.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fit_steps.hpp"
#include "followed_extent.hpp"
#include "line_ends.hpp"
#include "motion.hpp"
#include "observe.hpp"
#include "pool.hpp"
#include "tube_result.hpp"
#include "tubetrack/tracker/predict.hpp"
#include "tubetrack/tracker/stations.hpp"

namespace tubetrack {

namespace {

constexpr double kStraight = 0.003;  // radii, far below the noise of a reading

FitOptions frame_fit_options(const TrackerConfig& config, const FollowedTube& tube, const Information* prior) {
  FitOptions options;
  options.radius_m = config.radius_m ? config.radius_m : tube.held_radius_m;
  options.varying_radius = config.varying_radius;
  options.radius_min_m = 0.5 * config.radius_min_m;
  options.radius_max_m = 1.5 * config.radius_max_m;
  options.prior = prior;
  return options;
}

}  // namespace

void predict(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, const TubeModel& model) {
  predict_pixels(map, config.noise, model, 1, tube.pixels, kStraight);
  tube.predicted = model;
}

FrameView view_of(const FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, const TubeModel& model,
                  double near_radii, double far_radii) {
  const Gates gates{near_radii * model.radius_m, far_radii * model.radius_m, 4.0};
  thread_local Sighting sighting;  // for its buffers
  observe(map, config.noise, model.spline, tube.pixels, gates,
          {tube.extent.t_begin + tube.trim.at_begin, tube.extent.t_end - tube.trim.at_end}, sighting);
  const bool free_radius = !frame_fit_options(config, tube, nullptr).radius_m;
  FrameView view{observed_equations(model, sighting.near, free_radius), {}, {}};
  if (config.varying_radius) view.readings = sighting.near;
  if (far_radii <= near_radii) return view;
  view.all = observed_equations(model, sighting.far, free_radius);
  view.all += view.near;
  return view;
}

bool fit_once(FollowedTube& tube, const TrackerConfig& config, TubeModel& model, FrameView view,
              const Information& prior, const ProfileInformation* profile_prior, bool want_covariance) {
  FitOptions options = frame_fit_options(config, tube, &prior);
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
  tube.radius_information = information_of(tube.quality.radius_sigma_m);
}

bool is_stale(const FollowedTube& tube, const TubeModel& model) {
  constexpr double kStale = 0.04;
  return moved_m(tube.predicted, model, tube.extent) > kStale * model.radius_m;
}

bool fit_to_frame(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel model) {
  const Information nothing = no_information(model);
  predict(tube, map, config, model);
  if (!fit_once(tube, config, model, view_of(tube, map, config, model, 0.2, 0.2), nothing, nullptr, false))
    return false;
  if (is_stale(tube, model)) predict(tube, map, config, model);
  if (!fit_once(tube, config, model, view_of(tube, map, config, model, kFitGate, kFitGate), nothing, nullptr, true))
    return false;
  take_model(tube, std::move(model), config);
  return true;
}

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
    expected += station.expected - station.anothers;
  }
  tube.support = expected > 0 ? static_cast<double>(agree) / expected : 0.0;
  const bool enough = seen * station_m >= std::max(tube.model.radius_m, 0.010) && tube.support > 0.7;
  if (enough) {
    tube.extent = extent;
    tube.trim = trim_of(tube.model.spline, tube.stations, extent);
  }
  tube.state = enough ? TubeState::tracked : 2 * unknown > all && all > 0 ? TubeState::occluded : TubeState::lost;
}

}  // namespace tubetrack
