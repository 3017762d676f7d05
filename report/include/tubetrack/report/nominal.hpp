#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// What a bent tube should be: the XYZ points of its bend table, in any frame.
struct NominalTube {
  std::int64_t id = 0;  ///< as in the file
  std::vector<Eigen::Vector3d> xyz_m;
};

/// Reads a CSV as xyz_csv writes it (tube,point,x_m,y_m,z_m), at least 2 points a tube. The error names file, line,
/// value and fix; Error::usage where there is no such file.
Expected<std::vector<NominalTube>> read_nominal_csv(const std::filesystem::path& path);

/// One of the points that a bent tube is inspected by: an end, or where a bend begins or ends.
struct NominalPoint {
  enum class At { start, before_bend, behind_bend, end };
  At at = At::start;
  std::size_t point = 0;     ///< of the XYZ points, from 0
  double deviation_m = 0.0;  ///< from the measured point to the nominal one
  double sheath_m = 0.0;     ///< from the measured point to the nominal centreline: so far the sheaths are apart
};

/// A nominal tube, laid on the measured one. Its bends are taken to have the measured radii, which XYZ points don't
/// tell.
struct NominalComparison {
  std::int64_t nominal = 0;
  std::string problem;    ///< why there is nothing to compare, for people; the rest is empty then
  std::int64_t tube = 0;  ///< the measured one's id
  bool reversed = false;  ///< the measured tube was followed from the nominal one's other end
  double rms_m = 0.0;     ///< of the points' deviations, which the position was chosen by
  double max_deviation_m = 0.0;
  double max_sheath_m = 0.0;  ///< along all of the measured tube's bend table, not only at the points
  std::vector<NominalPoint> points;

  bool within(double tolerance_m) const {
    return problem.empty() && max_deviation_m <= tolerance_m && max_sheath_m <= tolerance_m;
  }
};

/// Each nominal tube against the measured tube that it fits best, of those with a bend table of as many points; rigidly
/// moved to the least squares of their points, from either end. A measured tube is taken once.
std::vector<NominalComparison> compare_with_nominal(std::span<const NominalTube> nominal, std::span<const Tube> tubes);

/// start, before_bend, behind_bend, end.
std::string_view nominal_point_name(NominalPoint::At at);

}  // namespace tubetrack
