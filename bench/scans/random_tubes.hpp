#pragma once

#include <cstdint>

#include "tubetrack/tracker/part_chain.hpp"

namespace tubetrack::bench {

/// A tube as a bender makes it, and how it was scanned.
struct RandomTube {
  PartChain chain;
  double radius_m = 0.0;
  double step_m = 0.0;                                   ///< of the mesh: a sixth to a tenth of the radius
  Eigen::Vector3d seen_from = Eigen::Vector3d::UnitZ();  ///< unit, across the tube by and large, as it lies on a floor
};

/// Of 1 to 6 bends of 30° to 180°, bend radius 1.5 to 10 diameters, planes turned at random, straights of 1 to 6
/// diameters, radius 4 to 15 mm; nowhere nearer to itself than a quarter of its radius. The same for the same seed.
RandomTube random_tube(std::uint64_t seed);

}  // namespace tubetrack::bench
