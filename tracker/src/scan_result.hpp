#pragma once

#include "scan_grow.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// A scan's tube as a result: nodes about half a radius apart between its ends, with their uncertainty, and its parts
/// and bend table, fitted to `grid`. The id is left to the caller.
Tube result_of(const ScanTube& found, const SurfelGrid& grid, const ScanTubesConfig& config);

}  // namespace tubetrack
