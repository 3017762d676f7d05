#pragma once

#include "tubetrack/tracker/follow.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// Most of what should be seen of a stretch is.
bool agrees(const Station& station);

/// Nothing can be said of a stretch: out of the picture, without a return, or behind something nearer.
bool hidden(const Station& station);

/// Lengthens an extent by what is surely seen; shortens it to what is seen, or hidden by something nearer. Empty where
/// nothing is left.
Extent confirmed_extent(const RecycledVector<Station>& stations, const Extent& before);

/// Grows the spline where the tube reaches its end, and drops what is far beyond the extent. All that is indexed by
/// control points or t goes with it.
void fit_spline_to_extent(FollowedTube& tube);

}  // namespace tubetrack
