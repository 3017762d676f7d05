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

/// What is in an accumulation map, in cell order; and room for what was before, so that no memory is asked for.
struct CastVotes {
  std::vector<CastVote> now;
  std::vector<CastVote> before;
};

/// Brings the map from the votes in `cast.now` to those of `surfels` (both in cell order, a cell once), after which it
/// equals one made anew from these surfels. Withdraws and casts what differs, or, where that is more, casts all of them
/// into the emptied map. `cast.now` then has a vote a surfel.
void recast(AccumulationMap& votes, CastVotes& cast, std::span<const Surfel> surfels);

}  // namespace tubetrack
