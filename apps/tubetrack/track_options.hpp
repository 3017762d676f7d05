#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "nominal_check.hpp"
#include "run.hpp"
#include "tubetrack/replay/recording.hpp"
#include "tubetrack/tracker/tracker_config.hpp"

namespace tubetrack {

/// The flags as typed: empty where not given. They are read here, not by CLI11, so that a malformed value gives one
/// line with the flag, the value and the form it takes.
struct TrackOptions {
  std::string radius, radius_range, config, threads, noise, depth_range, roi, deadline_ms;
  std::string out, overlay;
  NominalFlags nominal;
  bool varying_radius = false, view = false, no_timing = false, strict = false, quiet = false, print_config = false;
};

/// Flags about what is tracked: --radius, --radius-range, --varying-radius, --config, --threads, --noise,
/// --depth-range, --roi, --print-config.
void add_tracker_flags(CLI::App& command, TrackOptions& options);
/// --deadline-ms.
void add_deadline_flag(CLI::App& command, TrackOptions& options);
/// Flags about what comes out: --nominal, --tolerance, --out, --overlay, --view, --no-timing, --strict, --quiet.
void add_output_flags(CLI::App& command, TrackOptions& options);

/// Defaults, then --config, then the flags; validated. Errors are of kind usage and name the flag.
Expected<TrackerConfig> tracker_config_from(const TrackOptions& options, const TrackerConfig& defaults = {});
/// The same for a recording: without --noise its own noise model is the default, where a file `noise.json` lies in it.
/// A note on stderr says so, unless --quiet.
Expected<TrackerConfig> config_for_recording(const TrackOptions& options, const std::string& recording);
/// What `--noise` says: a built-in model's name, or a JSON file.
Expected<NoiseModel> noise_model_from(const std::string& flag);
/// A tracker for this camera; besides what the tracker checks, the region of interest must lie in the image.
Expected<TubeTracker> create_tracker(const TrackerConfig& config, const Intrinsics& intrinsics);
/// The output flags, and the smallest radius for the check against the scene. The error is of a nominal file or its
/// tolerance.
Expected<RunOptions> run_options_from(const TrackOptions& options, const TrackerConfig& config);

/// Flags about how a recording is read: --frames, --pace, --intrinsics, --depth-scale.
struct RecordingFlags {
  std::string frames, pace, intrinsics, depth_scale;
};
void add_recording_flags(CLI::App& command, RecordingFlags& flags);
Expected<RecordingOptions> recording_options_from(const RecordingFlags& flags);

}  // namespace tubetrack
