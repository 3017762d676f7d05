#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/intrinsics.hpp"

namespace tubetrack {

enum class FrameOutcome { ok, timeout, end_of_stream, device_lost, corrupt };

/// Fixed for as long as the source is open.
struct StreamInfo {
  std::string name;  ///< path or device URI, for messages
  Intrinsics intrinsics;
  double metres_per_unit = 0.001;
  bool has_poses = false;
  std::optional<std::int64_t> frame_count = {};  ///< known for recordings
  std::string device = {};                       ///< maker and name of a live device, as its driver says them
};

/// Where frames come from: a recording or a live device. The only abstract class of the project.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  virtual const StreamInfo& info() const = 0;

  /// Waits for the next frame, `patience` at the most. `frame` is valid until the next call unless its keep_alive is
  /// kept. On `corrupt`, `frame` has its index and timestamp and no pixels, and the stream goes on with the next call.
  virtual FrameOutcome next(DepthFrame& frame, std::chrono::milliseconds patience) = 0;

  /// Why the last call gave `corrupt` or `device_lost`, in one line.
  virtual const std::string& last_problem() const = 0;

  /// What people should know of the stream, in one line, and once: empty when asked again, and mostly. To be asked on
  /// the thread that calls `next`.
  virtual std::string take_note() { return {}; }

  /// Frames the source itself had to skip so far (a device that outran us).
  virtual std::int64_t dropped() const { return 0; }
};

}  // namespace tubetrack
