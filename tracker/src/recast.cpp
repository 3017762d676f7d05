#include "tubetrack/tracker/recast.hpp"

namespace tubetrack {

void recast(AccumulationMap& votes, std::vector<CastVote>& cast, std::span<const Surfel> surfels) {
  std::vector<CastVote> now;
  now.reserve(surfels.size());
  auto old = cast.begin();
  for (const Surfel& surfel : surfels) {
    for (; old != cast.end() && old->cell < surfel.cell; ++old) votes.withdraw(old->record);
    const VoteRecord record = vote_record(surfel, votes.cell_m());
    const bool known = old != cast.end() && old->cell == surfel.cell;
    if (!known || old->record != record) {
      if (known) votes.withdraw(old->record);
      votes.add(record);
    }
    if (known) ++old;
    now.push_back({surfel.cell, record});
  }
  for (; old != cast.end(); ++old) votes.withdraw(old->record);
  cast = std::move(now);
}

}  // namespace tubetrack
