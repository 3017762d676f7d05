#pragma once

#include "tubetrack/tracker/follow.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// The tubes that are followed, and the next one's id. Those of the first frame are confirmed at once where it shows
/// their shape well, for a single scan is all that some have; all others when two more frames have said so.
struct KnownTubes {
  RecycledVector<FollowedTube> tubes;
  std::int64_t next_id = 1;
  bool first_frame = true;
};

/// Takes in what was found where no known tube explains the image: a known tube that was out of sight and is back (the
/// same radius, nearest to where it was last seen), another piece of one that is in sight (both are joined), or a new
/// tube. A new tube gets the next id. Here and below `map` is as before in the end: while one tube is looked at, the
/// readings of the others are taken out.
void take_in(KnownTubes& known, RecycledVector<FoundTube> found, HeightMap& map, const TrackerConfig& config,
             double timestamp_s);

/// Asks now and then of tubes in sight that run on into each other whether they are one: then the one known longer goes
/// on, and the other's id is given up.
void join_known(KnownTubes& known, HeightMap& map, const TrackerConfig& config, double timestamp_s);

/// Asks again whether the tubes in sight are tubes, in their first frames and now and then later: forgets those that
/// are denied, which only looked like a tube in the noise of one frame, and confirms those that two frames bear out.
void confirm_or_forget(KnownTubes& known, HeightMap& map, const TrackerConfig& config);

/// Forgets what has not been seen for too long: 1 s where it should be in view, 3 s where something hides it.
void forget_old(KnownTubes& known, double timestamp_s);

}  // namespace tubetrack
