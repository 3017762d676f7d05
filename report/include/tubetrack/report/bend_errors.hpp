#pragma once

#include <cstdint>
#include <vector>

#include "tubetrack/replay/tube_truth.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

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

/// Compares the bend tables of a frame with the true tubes' bends, in the same frame of reference.
BendErrors bend_errors(const TruthFrame& truth, const TubeFrame& result);

}  // namespace tubetrack
