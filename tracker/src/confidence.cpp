#include "confidence.hpp"

#include <algorithm>
#include <cmath>

namespace tubetrack {

namespace {

constexpr double kMostTaper = 0.05;     // of a tube: change of radius per length
constexpr double kSurestTaper = 0.005;  // σ: what a sensor does to the shape in every frame alike is no average's

}  // namespace

void add_look(FollowedTube& tube, const Evidence& evidence) {
  if (!(evidence.taper_sigma > 0.0) || !std::isfinite(evidence.taper_sigma)) return;
  const double information = 1.0 / (evidence.taper_sigma * evidence.taper_sigma);
  tube.taper_information += information;
  tube.taper_sum += information * evidence.taper;
}

double confidence_of(const FollowedTube& tube) {
  if (tube.state != TubeState::tracked || tube.taper_information <= 0.0) return 0.0;
  const double taper = tube.taper_sum / tube.taper_information;
  const double sigma = std::max(kSurestTaper, 1.0 / std::sqrt(tube.taper_information));
  const auto below = [&](double limit) { return 0.5 * std::erfc((taper - limit) / (sigma * std::sqrt(2.0))); };
  return std::clamp(tube.support, 0.0, 1.0) * (below(kMostTaper) - below(-kMostTaper));
}

}  // namespace tubetrack
