#pragma once

#include <chrono>
#include <functional>
#include <memory>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/sensors/frame_source.hpp"

namespace tubetrack {

struct ReconnectOptions {
  std::chrono::milliseconds first_wait{100};     ///< before the first attempt to open the device again
  std::chrono::milliseconds longest_wait{2000};  ///< each wait is twice the one before, up to this
  std::chrono::milliseconds silence{5000};       ///< without a frame for so long the device counts as lost; 0: never
};

using ReopenDevice = std::function<Expected<std::unique_ptr<FrameSource>>()>;

/// A device that is opened again, by `reopen`, whenever it is lost: `next` says device_lost once, then `timeout` until
/// it is back, then goes on. Indices go on counting and times go on rising; a device whose clock starts anew goes on by
/// what passed on the host's clock. One that comes back with another size, unit or camera is refused, and asked again
/// later. `last_problem` says why it was lost, or why the last attempt to open it failed.
std::unique_ptr<FrameSource> reconnecting(std::unique_ptr<FrameSource> device, ReopenDevice reopen,
                                          const ReconnectOptions& options = {});

}  // namespace tubetrack
