#pragma once

#include <span>

#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/replay/scan_file.hpp"
#include "tubetrack/tracker/scan_tubes.hpp"

namespace tubetrack {

/// `find_scan_tubes`, with its results back where they belong: a georeferenced scan from where it was moved to, a
/// height map into the frame that its pose leads to. The grid step of `config` is the scan's; `any_radius`: its radii
/// as well.
Expected<TubeFrame> tubes_of_scan(const Scan& scan, std::span<const ScanSurfel> surfels, ScanTubesConfig& config,
                                  bool any_radius);

/// For people, on stderr: a line a tube.
void print_tubes(std::span<const Tube> tubes);

}  // namespace tubetrack
