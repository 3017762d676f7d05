#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// What can be made to go wrong with the virtual device (docs/live.md has the words and their units).
enum class FaultKind { stall, unplug, replug, time, clock, burst, drop, cut, hang, still };

struct Fault {
  FaultKind kind = FaultKind::stall;
  double amount = 0.0;     ///< seconds, or a number of frames (burst, drop, cut, still); unplug: below 0 stays away
  std::int64_t frame = 0;  ///< before which frame, counted from 0 since the driver was loaded
};

/// A script: one `FRAME FAULT [AMOUNT]` a line, frames rising, `#` begins a comment. The error names file and line.
Expected<std::vector<Fault>> read_fault_script(const std::filesystem::path& path);

/// `Device::invoke` takes these ids with one 32-bit integer, milliseconds or a number of frames: the fault comes at
/// once.
constexpr int kFirstFaultCommand = 0x54540001;
constexpr int fault_command(FaultKind kind) {
  return kFirstFaultCommand + static_cast<int>(kind);
}
/// Empty where the id is no fault's.
std::optional<Fault> fault_of_command(int id, std::int32_t value);

/// What is to happen with the next frame.
struct FaultTurn {
  double stall_s = 0.0;       ///< first be silent; frames due meanwhile are lost
  double time_shift_s = 0.0;  ///< added to the timestamp
  bool at_once = false;       ///< ahead of its time
  bool drop = false;
  bool cut = false;                      ///< half of its rows are missing
  bool still = false;                    ///< it has the timestamp of the frame before
  std::optional<double> unplug_for_s{};  ///< instead of the frame; below 0: for good
};

/// The script and what was ordered by hand, in the order they come due. Safe to use from any thread.
class Faults {
 public:
  explicit Faults(std::vector<Fault> script = {}) : script_(std::move(script)) {}

  void order(const Fault& fault);
  /// Counts a frame and says what is to happen with it.
  FaultTurn next_turn();
  /// How long stopping the stream is to take; asked once.
  double take_hang_s();

 private:
  void apply(const Fault& fault);

  std::mutex mutex_;
  std::vector<Fault> script_;
  std::size_t at_ = 0;
  std::int64_t frame_ = 0;
  FaultTurn next_;
  double clock_shift_s_ = 0.0;
  double hang_s_ = 0.0;
  int burst_left_ = 0;
  int drop_left_ = 0;
  int cut_left_ = 0;
  int still_left_ = 0;
};

}  // namespace tubetrack
