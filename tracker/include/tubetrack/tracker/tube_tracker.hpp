#pragma once

#include <memory>
#include <span>

#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/intrinsics.hpp"
#include "tubetrack/tracker/tracker_config.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// Follows every tube of a depth stream. Not thread-safe; one per stream.
class TubeTracker {
 public:
  /// The error names the field of the configuration or the intrinsics that can't be used.
  static Expected<TubeTracker> create(const TrackerConfig& config, const Intrinsics& intrinsics);

  TubeTracker(TubeTracker&&) noexcept;
  TubeTracker& operator=(TubeTracker&&) noexcept;
  ~TubeTracker();

  /// One frame's way through the paper: height map, normals, accumulation (algorithm 1), trace (algorithm 2), fit
  /// (section 2.3), parts (section 3). Valid until the next call; copy to keep. A frame of another size gives status
  /// `corrupt`.
  const TubeFrame& track(const DepthFrame& frame);

 private:
  struct State;
  explicit TubeTracker(std::unique_ptr<State> state);
  bool begin(const DepthFrame& frame);
  void ask_for_levels(const DepthFrame& frame);
  void follow_known(const DepthFrame& frame);
  void report_known();
  std::unique_ptr<State> state_;
};

}  // namespace tubetrack
