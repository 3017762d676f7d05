#pragma once

#include <optional>
#include <string>

#include "tubetrack/tracker/evidence.hpp"
#include "tubetrack/tracker/tracker_config.hpp"

namespace tubetrack {

/// A fitted tube with what speaks for it.
struct FoundTube {
  TubeModel model;
  Extent extent;
  FitQuality quality;
  Evidence evidence;
  std::vector<PredictedPixel> pixels;
};

/// From a rough line (≥ 2 points, metres) and radius to a fitted tube over all that is seen of it: fit, look how far the
/// image confirms the tube, lengthen or shorten it, fit again. Empty where the fit does not hold.
std::optional<FoundTube> grow_tube(const HeightMap& map, const TrackerConfig& config,
                                   const std::vector<Eigen::Vector3d>& line_m, double radius_m);

/// DESIGN §2, "A tube": long, wide and round enough, confirmed by the image, convex. The reason when it is none.
std::optional<std::string> why_no_tube(const FoundTube& found, const TrackerConfig& config);

}  // namespace tubetrack
