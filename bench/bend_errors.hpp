#pragma once

#include <cstdint>
#include <vector>

#include "tubetrack/replay/synthetic_scene.hpp"
#include "tubetrack/replay/tube_truth.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack::bench {

/// How well bends were measured. Those that DESIGN §5 asks for: 45° to 150°, a bend radius of 2.5 diameters or more, an
/// arc of 60 mm or more.
struct BendErrors {
  std::int64_t tubes = 0;        ///< true tubes with bends, reported
  std::int64_t tubes_right = 0;  ///< of these, with as many bends as they have; the errors are of these alone
  std::vector<double> angle_rad;
  std::vector<double> bend_radius_relative;
  std::vector<double> rotation_rad;  ///< one between two bends
};

void add(BendErrors& sum, const BendErrors& part);

/// Compares the bend tables of a frame with the parts that the scene's tubes are made of. The truth is that of the
/// scene's tubes in their order, in the result's frame of reference.
BendErrors bend_errors(const std::vector<SceneTube>& scene, const TruthFrame& truth, const TubeFrame& result);

}  // namespace tubetrack::bench
