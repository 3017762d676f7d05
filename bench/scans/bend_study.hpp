#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tubetrack/replay/scan_file.hpp"
#include "tubetrack/tracker/part_chain.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack::bench {

/// How far one measured number is off, and how far it said it might be (1 σ).
struct Deviation {
  double error = 0.0;
  double sigma = 0.0;
};

/// The numbers of the bend tables of tubes whose number of bends was right. Metres and radians.
struct BendDeviations {
  std::vector<Deviation> angle, radius, rotation, inner_length, end_length;
  std::vector<double> radius_relative;  ///< |error| over the bend radius
  std::vector<double> length_excess;    ///< |error| of all lengths over what they may: 0.1 mm and 0.2 mm a metre
};

/// Of one table against the chain it should describe, from the end that fits better. False where the number of bends
/// differs.
bool add_deviations(const PartChain& truth, const BendTable& table, BendDeviations& sum);

struct BendStudy {
  int tubes = 0;
  int right = 0;  ///< one tube with as many bends as it has
  BendDeviations deviations;
  std::vector<std::string> wrong;  ///< a line each
};

/// A scan of random tube `seed`, with noise of 1 % of the radius on every point.
Scan scan_of_random_tube(std::uint64_t seed, bool one_side);

/// Random tubes first_seed and on, found without being told anything.
BendStudy study_bends(std::uint64_t first_seed, int tubes, bool one_side);

double median_error(const std::vector<Deviation>& deviations);
/// The part whose truth lies in the 95 % interval.
double part_inside(const std::vector<Deviation>& deviations);

/// A table in Markdown: full scans and those from one side, beside the goals.
std::string bend_table_text(const BendStudy& full, const BendStudy& one_side);

}  // namespace tubetrack::bench
