#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tubetrack/report/nominal.hpp"
#include "tubetrack/sensors/error.hpp"
#include "tubetrack/tracker/joints.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// What is known of tubes beside them.
struct Findings {
  std::span<const TubeJoint> joints;
  std::span<const NominalComparison> nominal;
  std::optional<double> tolerance_m;  ///< of the nominal tubes, which pass or don't
};

/// The result's line: result_line with the keys `joints` and `nominal` where there are any.
std::string line_with_findings(const TubeFrame& frame, bool with_timing, const Findings& findings);

/// The inverse, to what the line holds.
struct ScanResult {
  TubeFrame frame;
  std::vector<TubeJoint> joints;
  std::vector<NominalComparison> nominal;
  std::optional<double> tolerance_m;
};
/// The error names the key. A line without `joints` or `nominal` has none.
Expected<ScanResult> parse_scan_line(std::string_view line);

/// start, end, flank.
std::string_view joint_part_name(TubeJoint::At at);

}  // namespace tubetrack
