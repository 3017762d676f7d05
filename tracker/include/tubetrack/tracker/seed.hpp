#pragma once

#include <optional>

#include "tubetrack/tracker/grow.hpp"

namespace tubetrack {

/// Where to start: a peak of the accumulation map, the tube's direction and radius there, and the line traced from it
/// (paper, algorithm 2) as far as it runs smoothly; fewer than 4 points say nothing of the course.
struct Seed {
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  double radius_m = 0.0;
  RecycledVector<Eigen::Vector3d> line_m;
};

/// A short straight piece of tube at a peak: first where it lies, then how thick it is. Empty where the image does not
/// show one, which is cheap to find out here.
std::optional<FoundTube> fit_seed(const HeightMap& map, const TrackerConfig& config, const Seed& seed);

}  // namespace tubetrack
