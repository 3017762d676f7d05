#pragma once

#include <cstdint>
#include <span>

#include "tubetrack/tracker/follow.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// Cells whose reading was taken out of the map for a time: there its sign is turned.
using HiddenCells = RecycledVector<std::uint32_t>;

/// A tube, the extent it is seen along, and its pixels in cell order.
struct SeenTube {
  const TubeModel& model;
  const Extent& extent;
  const PredictedPixels& pixels;
};
inline SeenTube seen(const FoundTube& tube) {
  return {tube.model, tube.extent, tube.pixels};
}
inline SeenTube seen(const FollowedTube& tube) {
  return {tube.model, tube.extent, tube.pixels};
}

/// May they be two pieces of one tube: does the end of one point along the other?
bool in_one_line(const FollowedTube& a, const FollowedTube& b);

/// For a look at one tube: takes out of the map what is another's, the readings that agree with it, so that they
/// neither pull at the one's fit nor speak for or against it. What both could have belongs to the one in front; `mine`
/// may be null where it is not known yet. Appends to `hidden`, in which `show_again` finds what to put back.
void hide_from(const SeenTube* mine, const SeenTube& other, HeightMap& map, HiddenCells& hidden);

/// Takes out of the map what was read beside pixels that should see the tube and have no return, as at the edge of a
/// shadow on it: what the sensor's lateral jitter moved over that edge is missing there, and the mean of what is left
/// lies aside.
void hide_beside_gaps(const SeenTube& mine, HeightMap& map, HiddenCells& hidden);

/// The same for all that are in sight, from one of them or (`self` null) from a new one. Where
/// one runs on into the other nothing is hidden, nor by what is not confirmed from what is: they may be pieces of one.
void hide_others(std::span<const FollowedTube> tubes, const FollowedTube* self, const SeenTube* mine, HeightMap& map,
                 HiddenCells& hidden);

/// Puts back all that was hidden.
void show_again(HeightMap& map, HiddenCells& hidden);

}  // namespace tubetrack
