#include <algorithm>
#include <cmath>
#include <utility>

#include "confidence.hpp"
#include "followed_extent.hpp"
#include "frame_fit.hpp"
#include "line_ends.hpp"
#include "pool.hpp"
#include "tubetrack/tracker/evidence.hpp"
#include "tubetrack/tracker/follow.hpp"
#include "tubetrack/tracker/stations.hpp"

namespace tubetrack {

namespace {

constexpr double kBentEnd = 1.0;  // spans at an end that may be bent

/// Goes on along what the image confirms until so many rounds brought nothing more, or none without a bend that no tube
/// has.
void lengthen(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, int patience) {
  constexpr int kMostRounds = 40;
  int stalled = 0;
  for (int round = 0; round < kMostRounds && stalled < patience; ++round) {
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

/// Does the image confirm it beyond its extent? Where nothing shows before it is fitted there, nothing does after.
bool goes_on(const FollowedTube& tube) {
  constexpr double kLeast = 0.1;  // spans; `lengthen` asks for more in a round
  const Extent confirmed = confirmed_extent(tube.stations, tube.extent);
  return std::max(tube.extent.t_begin - confirmed.t_begin, confirmed.t_end - tube.extent.t_end) > kLeast;
}

double length_m(const FollowedTube& tube) {
  return (tube.extent.t_end - tube.extent.t_begin) * kKnotSpacingRadii * tube.model.radius_m;
}

void pool_first_frame(FollowedTube& tube) {
  tube.radius_information = information_of(tube.quality.radius_sigma_m);
  start_pool(tube);
  tube.pooled = no_information(tube.model);  // the radius is in what was observed
  add_to_pool(tube);
  tube.profile_pool = {};
  add_to_profile_pool(tube);
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
  tube.trim = trim_of(tube.model.spline, tube.stations, tube.extent);
  // A little more at an end may be the foot of a can or the table that it stands on; much more is tube.
  if (found.joined || goes_on(tube)) {
    FollowedTube longer = tube;
    lengthen(longer, map, config, found.joined ? 3 : 1);
    if (found.joined || length_m(longer) - length_m(tube) > 2.0 * tube.model.radius_m) tube = std::move(longer);
  }
  tube.last_seen_s = timestamp_s;
  pool_first_frame(tube);
  return tube;
}

void pool_without_ends(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  if (length_m(tube) <= 8.0 * tube.model.radius_m) return;
  if (tube.trim.at_begin <= 0.0 && tube.trim.at_end <= 0.0) return;
  FollowedTube without = tube;
  // From ends that were bent into hooks the prior, which takes large bends for granted, would not come back.
  TubeModel start = tube.model;
  const bool hooks_at_begin = tube.trim.at_begin > 0.0, hooks_at_end = tube.trim.at_end > 0.0;
  continue_from(start.spline, hooks_at_begin ? tube.extent.t_begin + kBentEnd : -1.0,
                hooks_at_end ? tube.extent.t_end - kBentEnd : tube.model.spline.spans() + 1.0);
  if (!fit_to_frame(without, map, config, std::move(start))) return;
  const TurnedEnds faces = turned_to_camera(tube.model.spline, tube.extent);
  // Where the ends tell much of the radius, that they bend the line costs less than leaving them out.
  const bool costs_little = without.quality.radius_sigma_m <= 1.1 * tube.quality.radius_sigma_m;
  if (costs_little && (faces.at_begin || faces.at_end)) {
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

}  // namespace tubetrack
