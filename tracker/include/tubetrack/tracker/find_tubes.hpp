#pragma once

#include <span>
#include <vector>

#include "tubetrack/tracker/grow.hpp"
#include "tubetrack/tracker/recast.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// The voxel size that matches the sensor where the surfels are: about two pixels, in powers of √2 so that it does not
/// flicker from frame to frame. 0 when there are no surfels.
double matching_cell_m(std::span<const Surfel> surfels, double focal_px);

/// All tubes that the votes and the image agree on, best peak first: trace from the best peak, fit, withdraw the votes
/// of the surfels that the tube explains, go on with the best peak that is left. `votes` holds `cast`, one vote a
/// surfel, and holds it again in the end.
std::vector<FoundTube> find_tubes(AccumulationMap& votes, std::span<const Surfel> surfels,
                                  std::span<const CastVote> cast, const HeightMap& map,
                                  const TrackerConfig& config, StageTimes& times);

}  // namespace tubetrack
