#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// One frame as one JSON object without line end, keys as in docs/output.schema.json. Lengths are rounded to 1 µm,
/// uncertainties to 3 digits. Without timing, latency_ms and stages_ms are left out: equal runs give equal bytes.
std::string result_line(const TubeFrame& frame, bool with_timing);

/// The inverse, to what the line holds. The error names the key.
Expected<TubeFrame> parse_result_line(std::string_view line);

/// A whole JSON-lines file; empty lines are skipped. The error names file and line.
Expected<std::vector<TubeFrame>> read_result_lines(const std::filesystem::path& path);

/// ok, empty, corrupt, no_pose, deadline.
std::string_view status_name(TrackStatus status);

}  // namespace tubetrack
