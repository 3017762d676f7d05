#pragma once

#include <optional>
#include <string>

#include "tubetrack/tracker/evidence.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/tracker_config.hpp"

namespace tubetrack {

/// A fitted tube with what speaks for it.
struct FoundTube {
  TubeModel model;
  Extent extent;
  FitQuality quality;
  Evidence evidence;
  PredictedPixels pixels;
  std::optional<double> held_radius_m = {};  ///< set where the silhouettes, not the surface, say how thick it is
  bool joined = false;                       ///< of two pieces: its ends have not been looked for yet
};

/// From a fitted seed to a fitted tube over all that is seen of it: fit, look how far the image confirms the tube,
/// lengthen or shorten it, fit again. Along a line that was traced (paper, algorithm 2), unless it has fewer than 4
/// points or leads to no tube. Empty where the image shows no tube there.
std::optional<FoundTube> grow_tube(const HeightMap& map, const TrackerConfig& config, const FoundTube& start,
                                   const RecycledVector<Eigen::Vector3d>& line_m);

/// Goes on straight behind what is nearer and hides an end of the tube (or a stretch of up to 15 radii), and takes in
/// what is seen of it beyond; leaves a tube that nothing more is seen of as it is.
void go_on_behind(const HeightMap& map, const TrackerConfig& config, FoundTube& tube);

/// Fits and judges a tube again in a map that has changed. Leaves one as it is that is no tube there, or is much
/// shorter.
void fit_again(const HeightMap& map, const TrackerConfig& config, FoundTube& tube);

/// Why something is no tube, for people.
using Reason = std::basic_string<char, std::char_traits<char>, RecyclingAllocator<char>>;

/// DESIGN §2, "A tube": long, wide and round enough, confirmed by the image, convex. The reason when what was seen of
/// one of radius_m (metres) is none.
std::optional<Reason> why_no_tube(const Evidence& evidence, double radius_m, const TrackerConfig& config);

}  // namespace tubetrack
