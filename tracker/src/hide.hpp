#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tubetrack/tracker/follow.hpp"

namespace tubetrack {

/// Cells whose reading was taken out of the map for a time: there its sign is turned.
using HiddenCells = std::vector<std::uint32_t>;

/// For a look at one tube: hides from it what of the image is another's, so that these pixels neither pull at its fit
/// nor speak for or against it. `pixels` are the other's, with its model and the extent it is seen along; its own are
/// those in which the reading agrees with it. `mine` are the pixels of the tube that is looked at, in cell order, or
/// empty where it is not known yet: what both could have belongs to the one in front. Appends to `hidden`, in which
/// `show_again` finds what to put back.
void hide_from(const std::vector<PredictedPixel>& mine, const TubeModel& model, const Extent& extent,
               const std::vector<PredictedPixel>& pixels, HeightMap& map, HiddenCells& hidden);

/// From one of these tubes, or from a new one, all that are in sight but itself.
void hide_others(std::span<const FollowedTube> tubes, const FollowedTube* self, const std::vector<PredictedPixel>& mine,
                 HeightMap& map, HiddenCells& hidden);

/// Puts back all that was hidden.
void show_again(HeightMap& map, HiddenCells& hidden);

}  // namespace tubetrack
