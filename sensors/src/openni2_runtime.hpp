#pragma once

// Private to the OpenNI2 back-end: the one header that includes OpenNI2's.
#include <OpenNI.h>

#include <atomic>
#include <memory>
#include <string>
#include <utility>

#include "tubetrack/sensors/openni2_source.hpp"

namespace tubetrack {

/// The initialised runtime; it is shut down with the last user.
struct OpenNi2Runtime {
  OpenNi2Runtime() = default;
  ~OpenNi2Runtime() { openni::OpenNI::shutdown(); }
  OpenNi2Runtime(const OpenNi2Runtime&) = delete;
  OpenNi2Runtime& operator=(const OpenNi2Runtime&) = delete;
};
Expected<std::shared_ptr<OpenNi2Runtime>> use_openni2();

/// With the runtime in use.
std::vector<DeviceDescription> openni2_devices_now();

/// The runtime's own words for the last error, as one line.
std::string openni2_says();

inline tl::unexpected<Error> openni2_failed(std::string text) {
  return tl::make_unexpected(Error::failed(std::move(text)));
}

/// Hears that a device was unplugged: `isValid()` stays true then, and waits only time out.
class UnplugListener final : public openni::OpenNI::DeviceDisconnectedListener {
 public:
  explicit UnplugListener(std::string uri);
  ~UnplugListener() override;
  UnplugListener(const UnplugListener&) = delete;
  UnplugListener& operator=(const UnplugListener&) = delete;

  bool unplugged() const { return unplugged_; }

 private:
  void onDeviceDisconnected(const openni::DeviceInfo* info) override;

  std::string uri_;
  std::atomic<bool> unplugged_ = false;
};

/// Metres per unit of a depth format; 0 for formats that are no depth in metres (raw shifts).
double metres_per_unit_of(openni::PixelFormat format);

/// "640x480@30 1 mm".
std::string describe(const openni::VideoMode& mode);

/// The offered mode that fits and comes nearest to 640×480 at 30, then to what the device has set.
Expected<openni::VideoMode> choose_openni2_mode(const std::string& name, const openni::VideoStream& stream,
                                                const OpenNi2Options& want);

/// Sets the mode, no mirroring and the cropping that are asked for. `mirrored`: the device mirrors whatever it is told.
/// The size and unit of `info` are set.
Expected<void> set_up_openni2_stream(openni::VideoStream& stream, const OpenNi2Options& options, StreamInfo& info,
                                     bool& mirrored);

/// Of the stream as it is set up: from the calibration, the numbers given, or the field of view, in this order.
Expected<Intrinsics> openni2_intrinsics(const openni::VideoStream& stream, const OpenNi2Options& options,
                                        const std::string& name);

/// Copies the rows of a frame, which has the size of `info`, flipped where it is mirrored.
void copy_openni2_pixels(const openni::VideoFrameRef& from, const Intrinsics& size, bool mirrored, std::uint16_t* to);

/// Why a frame is not what the stream is set up for; empty where it is.
std::string openni2_frame_problem(const openni::VideoFrameRef& frame, const Intrinsics& size);

}  // namespace tubetrack
