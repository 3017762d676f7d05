#pragma once

#include <string>

#include "nominal_check.hpp"
#include "tubetrack/report/scan_json.hpp"
#include "tubetrack/sensors/frame_source.hpp"
#include "tubetrack/tracker/tracker_config.hpp"

namespace tubetrack {

struct PlaneRunOptions {
  std::string out;             ///< JSON line; empty: stdout
  std::string save_heightmap;  ///< .png; empty: none
  double cell_size_m = 0.0;    ///< 0: matched to the sensor
  bool any_radius = true;      ///< radii as the map can show them, not those of the configuration
  bool with_timing = true;
  bool strict = false;  ///< a frame that is left out makes the exit code 1
  bool quiet = false;
  NominalCheck nominal;
};

/// Fuses all frames of a recording into heights over the largest plane of the first (DESIGN §2, metric grid), then
/// finds the tubes of that map as those of a static scan: one line, of the last frame, in the frame of the recording's
/// poses or of its camera. Frames without a pose and corrupt ones are left out and counted on stderr. Ctrl-C ends the
/// fusing, not the search. Returns the exit code: 0 done; 130 ended by Ctrl-C. An error: no plane, no good frame, or
/// the recording can't be read to its end, or a
/// nominal tube is out of its tolerance.
Expected<int> run_plane_map(FrameSource& source, const TrackerConfig& config, const PlaneRunOptions& options);

}  // namespace tubetrack
