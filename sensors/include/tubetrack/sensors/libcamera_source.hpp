#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tubetrack/sensors/device_description.hpp"
#include "tubetrack/sensors/error.hpp"
#include "tubetrack/sensors/frame_source.hpp"
#include "tubetrack/sensors/reconnect.hpp"

namespace tubetrack {

/// What is asked of a libcamera camera that sends depth as grey values. libcamera says neither the unit nor the camera:
/// both must be given.
struct LibcameraOptions {
  int width = 0;  ///< 0: 640×480 where it has that, else the first size it offers
  int height = 0;
  std::string format;                                  ///< as libcamera names it; empty: the one with the most bits
  double metres_per_unit = 0.0;                        ///< of one grey value
  std::optional<std::array<double, 4>> intrinsics_px;  ///< fx, fy, cx, cy
  std::optional<Intrinsics> calibration;               ///< with distortion; wins over intrinsics_px
};

/// Every camera that libcamera lists now, URIs as `libcamera:ID`. Empty also where a camera sends only Y16 or Z16: this
/// is for libcamera 0.3.0 and later. Not while one is open: libcamera takes one manager a process.
Expected<std::vector<DeviceDescription>> list_libcamera_devices();

/// Opens a camera (empty: the first that has a format which can carry depth) and starts its stream. Formats: R8, R10,
/// R12 (16 bits each but for R8), R10_CSI2P, and 16-bit carriers: SBGGR16 and its like, YUYV. 0 is "no return".
/// Frames carry the camera's own timestamps, count from 0 by its sequence numbers (a gap is counted in `dropped`; what
/// arrives after a later frame is left out) and own their pixels. A frame the kernel marks as broken is `corrupt`.
/// `device_lost` is final; a camera that stalls gives `timeout`.
Expected<std::unique_ptr<FrameSource>> open_libcamera(const std::string& id, const LibcameraOptions& options);

/// The same, opened again whenever it is lost (reconnect.hpp), with a manager of its own each time.
Expected<std::unique_ptr<FrameSource>> open_libcamera_reconnecting(const std::string& id,
                                                                   const LibcameraOptions& options,
                                                                   const ReconnectOptions& reconnect = {});

}  // namespace tubetrack
