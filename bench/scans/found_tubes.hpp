#pragma once

#include <span>

#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/replay/scan_file.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack::bench {

/// The tubes of a scan as `tubetrack scan` finds them (apps/tubetrack/scan_result.cpp), told nothing.
TubeFrame found_tubes(const Scan& scan, std::span<const ScanSurfel> surfels);

}  // namespace tubetrack::bench
