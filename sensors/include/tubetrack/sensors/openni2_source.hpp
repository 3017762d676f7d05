#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/sensors/frame_source.hpp"

namespace tubetrack {

/// A device that a live back-end can open.
struct DeviceDescription {
  std::string uri;  ///< what `open_openni2` takes
  std::string vendor;
  std::string name;
};

/// What is asked of an OpenNI2 device. What is left at 0 is chosen: 640×480 at 30 frames a second where the device has
/// it, then what the device has set already.
struct OpenNi2Options {
  int width = 0;
  int height = 0;
  int fps = 0;
  double metres_per_unit = 0.0;                        ///< 0.001 or 0.0001: the two units OpenNI2 knows
  std::optional<std::array<double, 4>> intrinsics_px;  ///< fx, fy, cx, cy: for a principal point off the centre
};

/// Every OpenNI2 device plugged in now; empty when there is none. The error says that the runtime has no driver.
Expected<std::vector<DeviceDescription>> list_openni2_devices();

/// Opens a device (empty URI: the first one) and starts its depth stream, mirroring off. Intrinsics come from the field
/// of view, f rounded to 1e-3 px, with the principal point in the centre: OpenNI2 can't say more.
/// Frames carry the device's own timestamps, count from 0 by the device's index (a gap is counted in `dropped`) and own
/// their pixels, so they may outlive the source. `device_lost` is final; a device that stalls gives `timeout`.
Expected<std::unique_ptr<FrameSource>> open_openni2(const std::string& uri, const OpenNi2Options& options);

}  // namespace tubetrack
