#include "tubetrack/tracker/recast.hpp"

namespace tubetrack {

namespace {

/// Calls `withdraw` and `add` with the records in which two lists differ.
template <typename Withdraw, typename Add>
void compare(const CastVotes& cast, const Withdraw& withdraw, const Add& add) {
  auto old = cast.before.begin();
  const auto end = cast.before.end();
  for (const CastVote& vote : cast.now) {
    for (; old != end && old->cell < vote.cell; ++old) withdraw(old->record);
    const bool known = old != end && old->cell == vote.cell;
    if (!known || old->record != vote.record) {
      if (known) withdraw(old->record);
      add(vote.record);
    }
    if (known) ++old;
  }
  for (; old != end; ++old) withdraw(old->record);
}

}  // namespace

void recast(AccumulationMap& votes, CastVotes& cast, std::span<const Surfel> surfels) {
  cast.before.swap(cast.now);
  cast.now.clear();
  for (const Surfel& surfel : surfels) cast.now.push_back({surfel.cell, vote_record(surfel, votes.cell_m())});
  std::size_t differences = 0;
  const auto count = [&](const VoteRecord&) { ++differences; };
  compare(cast, count, count);
  if (differences > cast.now.size()) {
    votes.clear();
    for (const CastVote& vote : cast.now) votes.add(vote.record);
    return;
  }
  compare(
      cast, [&](const VoteRecord& record) { votes.withdraw(record); },
      [&](const VoteRecord& record) { votes.add(record); });
}

}  // namespace tubetrack
