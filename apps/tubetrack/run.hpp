#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>

#include "interrupts.hpp"
#include "nominal_check.hpp"
#include "tubetrack/sensors/frame_source.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack {

struct RunOptions {
  std::filesystem::path out;          ///< JSON lines; empty: stdout
  std::filesystem::path overlay_dir;  ///< one PNG a frame; empty: none
  bool view = false;                  ///< a window with the newest result
  bool with_timing = true;            ///< latency_ms and stages_ms in the lines
  bool strict = false;                ///< one bad frame makes the exit code 1
  bool quiet = false;                 ///< no progress bar, no summary
  bool realtime = false;              ///< capture on its own thread; drop the oldest frame where tracking can't keep up
  std::size_t queue_frames = 2;       ///< of the queue between capture and tracking
  int interrupted_exit_code = 130;    ///< after Ctrl-C; a live run, which has no other end, sets 0
  bool survive_loss = false;          ///< a lost device is waited for: the source opens it again (reconnect.hpp)
  double status_every_s = 0.0;        ///< live: a line about the run on stderr so often; 0: none
  std::string hint_without_tubes;     ///< on stderr where no frame had a tube
  NominalCheck nominal;               ///< tubes are judged against, in every frame and, for people, at the end
  double smallest_radius_m = 0.0;     ///< refused where it is larger than the first frame's median depth
  /// Sees every good frame before it is tracked, on the capturing thread; an error ends the run. May be empty.
  std::function<Expected<void>(const DepthFrame&)> on_frame;
  /// A fresh tracker for a device that is back from a loss; empty: the old one goes on with its map and tubes. Tubes of
  /// a fresh one have ids that no tube had before.
  std::function<Expected<TubeTracker>()> fresh_tracker;
};

/// Tracks until the stream ends, the device is lost (unless that is survived) or Ctrl-C; writes one line a frame, each
/// flushed whole. Returns the exit code: 0 done; 1 lost, unwritable, all frames bad, one bad with `strict`, or a
/// nominal tube out of its tolerance in the last frame that shows it; 2 radius larger than the scene.
int run_tracker(FrameSource& source, TubeTracker& tracker, const RunOptions& options);

/// The result of one frame: the tracker's where the frame is good, else a line with its status and why. `outcome` is ok
/// or corrupt. latency_ms is set here.
TubeFrame track_or_explain(FrameOutcome outcome, const DepthFrame& frame, const std::string& problem,
                           const StreamInfo& info, TubeTracker& tracker);

/// Median of the pixels with a return, in metres; 0 where there is none. Every 4th row and column are looked at.
double median_depth_m(const DepthFrame& frame);

/// Prints "tubetrack: message" to stderr and returns the exit code that belongs to the error's kind.
int report_error(const Error& error);

}  // namespace tubetrack
