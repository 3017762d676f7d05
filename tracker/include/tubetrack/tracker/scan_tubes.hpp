#pragma once

#include <optional>
#include <span>

#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/sensors/error.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// What is looked for in a static scan. All but the grid step has a default.
struct ScanTubesConfig {
  double grid_step_m = 0.0;        ///< distance of neighbouring surfels: what the scan resolves
  double radius_min_m = 0.005;     ///< radii that are looked for, and no others are reported
  double radius_max_m = 0.100;     ///< above radius_min_m
  std::optional<double> radius_m;  ///< known: held, and the range is not looked at
  /// Grid step of the accumulation map; empty: about three eighths of the radius that is looked for, but not below
  /// grid_step_m.
  std::optional<double> cell_m;
  double min_length_radii = 1.5;  ///< a shorter tube is not reported
  double min_arc_rad = 2.0;       ///< nor one of whose section less is seen: a rounded edge of a box shows 90° (1.57)
};

/// Names the first field out of its range, what it got and what it takes.
Expected<void> validate(const ScanTubesConfig& config);

/// All tubes of a static scan, in the scan's frame: the second entry to the tracker (the first is
/// TubeTracker::track). Surfels vote along their inward normals (paper, section 2.1 and algorithm 1), from good peaks
/// lines are traced (section 2.2 and algorithm 2), fitted to the surface (section 2.3) and cut into straight and toric
/// parts (section 3). A tube that comes back to its start is `closed`. Longest first, ids from 1. `config` must be
/// valid. The frame has `frame` 0, `frame_id` "scan", and status `empty` where no tube was found.
TubeFrame find_scan_tubes(std::span<const ScanSurfel> surfels, const ScanTubesConfig& config);

}  // namespace tubetrack
