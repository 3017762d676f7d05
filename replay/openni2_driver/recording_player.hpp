#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "tubetrack/replay/recording.hpp"

namespace tubetrack {

/// What the virtual device does after the recording's last frame.
enum class AtEnd { repeat, stall, unplug };

/// The virtual device's settings. OpenNI2 has no way to hand them over, so they come from the environment
/// (docs/live.md).
struct PlayerSettings {
  std::filesystem::path recording;
  RecordingOptions options;
  AtEnd at_end = AtEnd::repeat;
  double speed = 1.0;  ///< 2: twice as fast as recorded
  std::filesystem::path
      lockstep;  ///< frame n (from 0) waits until this file has n lines; empty: frames keep their time
};

/// Reads TUBETRACK_VIRTUAL_DEVICE and its companions; the error names the variable. The recording is empty where
/// TUBETRACK_VIRTUAL_DEVICE isn't set.
Expected<PlayerSettings> player_settings_from_environment();

/// Writes the frame's part from (origin_u, origin_v) of width × height pixels, dense, in units of `metres_per_unit`,
/// mirrored left to right where asked. Equal units copy the values; others are rounded, and what doesn't fit into 16
/// bits becomes 0, "no return".
struct OutputFormat {
  double metres_per_unit = 0.001;
  bool mirrored = false;
  int origin_u = 0;
  int origin_v = 0;
  int width = 0;
  int height = 0;
};
void write_pixels(const DepthFrame& frame, const OutputFormat& format, std::uint16_t* out);

/// What the player calls, on its own thread.
struct PlayerCallbacks {
  /// Whether the program can take the first frame: the runtime throws away what comes before its `start` has returned.
  /// Waited for 250 ms at the most, in lockstep as long as it takes.
  std::function<bool()> ready;
  /// Each good frame; timestamps and indices go on rising over repeats. A corrupt frame is skipped and leaves a gap in
  /// the index.
  std::function<void(const DepthFrame&)> on_frame;
  /// Once, after the last frame, when at_end is `unplug`.
  std::function<void()> on_unplug;
};

/// Plays a recording on a thread of its own, each frame at its time.
class RecordingPlayer {
 public:
  RecordingPlayer(PlayerSettings settings, PlayerCallbacks callbacks);
  /// Stops; waits for a callback that is running.
  ~RecordingPlayer();

 private:
  using Clock = std::chrono::steady_clock;

  void run(const std::stop_token& stop);
  /// Plays it once; the number of frames sent.
  std::int64_t play_once(FrameSource& source, const std::stop_token& stop);
  void wait_until_ready(const std::stop_token& stop);
  void wait_for_turn(double timestamp_s, const std::stop_token& stop);
  void wait_until(Clock::time_point due, const std::stop_token& stop);

  PlayerSettings settings_;
  PlayerCallbacks callbacks_;
  Clock::time_point started_;
  double first_timestamp_s_ = 0.0;
  double offset_s_ = 0.0;  ///< added to the recording's timestamps in this round
  std::int64_t sent_ = 0;
  std::int64_t next_index_ = 0;
  double next_timestamp_s_ = 0.0;  ///< where a repeat would go on
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;  ///< last: it uses everything above
};

}  // namespace tubetrack
