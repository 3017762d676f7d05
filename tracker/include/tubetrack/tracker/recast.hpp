#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tubetrack/tracker/accumulation_map.hpp"

namespace tubetrack {

/// A vote that is in the accumulation map, and the height-map cell whose surfel cast it.
struct CastVote {
  std::uint32_t cell = 0;
  VoteRecord record;
};

/// Brings the map from the votes in `cast` to those of `surfels` (both in cell order, a cell once): withdraws and casts
/// only what differs, after which the map equals one made anew from these surfels. `cast` then has a vote a surfel.
void recast(AccumulationMap& votes, std::vector<CastVote>& cast, std::span<const Surfel> surfels);

}  // namespace tubetrack
