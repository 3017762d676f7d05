#pragma once

#include <span>
#include <vector>

#include "tubetrack/tracker/accumulation_map.hpp"
#include "tubetrack/tracker/grow.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// The voxel size that matches the sensor where the surfels are: about two pixels, in powers of √2 so that it does not
/// flicker from frame to frame. 0 when there are no surfels.
double matching_cell_m(std::span<const Surfel> surfels, double focal_px);

/// All tubes that the votes and the image agree on, best peak first: trace from the best peak, fit, withdraw the votes
/// of the surfels that the tube explains, go on with the best peak that is left. `map` holds the votes of `records`,
/// one a surfel, and loses those that were explained.
std::vector<FoundTube> find_tubes(AccumulationMap& votes, std::span<const Surfel> surfels,
                                  std::span<const VoteRecord> records, const HeightMap& map,
                                  const TrackerConfig& config, StageTimes& times);

}  // namespace tubetrack
