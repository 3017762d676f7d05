#pragma once

#include <span>

#include "tubetrack/tracker/deadline.hpp"
#include "tubetrack/tracker/follow.hpp"
#include "tubetrack/tracker/grow.hpp"
#include "tubetrack/tracker/recast.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// The voxel size that matches the sensor where the surfels are: about two pixels, in powers of √2 so that it does not
/// flicker from frame to frame. 0 when there are no surfels.
double matching_cell_m(std::span<const Surfel> surfels, double focal_px);

/// A place where a peak turned out to be no tube: not tried again for some frames unless many more votes meet there,
/// and each time that it fails again for twice as many.
struct FailedPlace {
  Eigen::Vector3d position_m;
  double radius_m = 0.0;
  int votes = 0;
  int rest_frames = 0;  ///< how long it is left alone
  int frames = 0;       ///< since it failed; it is remembered for twice its rest
};

/// Has a peak too few votes for a tube as thick as they say? Nearly every pixel that sees a tube votes, and those over
/// the length of a box meet in it; noise, and what bends a little, has less. So it costs no fit to refuse it. `box`:
/// the sum over 3³ voxels around the peak; `px_per_m`: the focal length over the depth there.
bool is_sparse(const Voxel& box, double radius_m, double cell_m, double px_per_m);

/// All tubes that the votes and the image agree on, best peak first: trace from the best peak, fit, withdraw the votes
/// of the surfels that the tube explains, go on with the best peak that is left. `votes` holds `cast`, which has a vote
/// a surfel; what is withdrawn is taken out of both, as the next frame's surfels leave out what is explained. Stops
/// after `max_failures` seeds that were no tubes, or with the seed at hand
/// when the deadline passes; `failed` carries the failures from frame to frame, so that the next frame tries others.
/// While it runs, readings of `map` that belong to a `known` tube in sight or to a neighbour are taken out of it; in
/// the end it is as it was.
RecycledVector<FoundTube> find_tubes(AccumulationMap& votes, std::span<const Surfel> surfels,
                                     std::vector<CastVote>& cast, std::span<const FollowedTube> known, HeightMap& map,
                                     const TrackerConfig& config, int max_failures, Deadline& deadline,
                                     RecycledVector<FailedPlace>& failed, StageTimes& times);

}  // namespace tubetrack
