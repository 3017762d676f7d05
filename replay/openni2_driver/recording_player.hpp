#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "faults.hpp"
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
  double speed = 1.0;                  ///< 2: twice as fast as recorded
  std::filesystem::path lockstep;      ///< frame n (from 0) waits until this file has n lines more than at the stream's
                                       ///< start; empty: frames keep their time
  std::filesystem::path fault_script;  ///< empty: none
  bool always_mirrored = false;        ///< the device does not switch mirroring off
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
  int step = 1;  ///< 2: every second row and column; origin and size count those
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
  /// `cut`: half of its rows are missing.
  std::function<void(const DepthFrame&, bool cut)> on_frame;
  /// What is to happen with the next frame; asked once for each.
  std::function<FaultTurn()> next_turn;
  /// Where a fault says so, and after the last frame when at_end is `unplug`; no frame follows. The device is back
  /// after `back_after_s`, below 0 never.
  std::function<void(double back_after_s)> on_unplug;
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
  /// False where the frame is not to be sent: lost in a stall, dropped, or the device is unplugged.
  bool wait_for_turn(double timestamp_s, const FaultTurn& turn, const std::stop_token& stop);
  void wait_until(Clock::time_point due, const std::stop_token& stop);

  PlayerSettings settings_;
  PlayerCallbacks callbacks_;
  Clock::time_point started_;
  double first_timestamp_s_ = 0.0;
  double zero_shift_s_ = 0.0;       ///< a clock that was set back beyond 0 begins with 0
  double offset_s_ = 0.0;           ///< added to the recording's timestamps in this round
  Clock::time_point silent_until_;  ///< what was due before is lost
  bool unplugged_ = false;
  std::int64_t lines_at_start_ = 0;  ///< of the lockstep file
  std::int64_t played_ = 0;
  std::int64_t sent_ = 0;
  std::int64_t next_index_ = 0;
  double next_timestamp_s_ = 0.0;  ///< where a repeat would go on
  std::optional<double> last_sent_s_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;  ///< last: it uses everything above
};

}  // namespace tubetrack
