#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tubetrack/sensors/device_description.hpp"
#include "tubetrack/sensors/error.hpp"
#include "tubetrack/sensors/frame_source.hpp"
#include "tubetrack/sensors/reconnect.hpp"

namespace tubetrack {

/// What is asked of an OpenNI2 device. What is left at 0 is chosen: 640×480 at 30 frames a second where the device has
/// it, then what the device has set already.
struct OpenNi2Options {
  int width = 0;
  int height = 0;
  int fps = 0;
  double metres_per_unit = 0.0;                        ///< 0.001 or 0.0001: the two units OpenNI2 knows
  std::optional<std::array<double, 4>> intrinsics_px;  ///< fx, fy, cx, cy: for a principal point off the centre
  std::optional<Intrinsics> calibration;               ///< of the whole image, with distortion; wins over intrinsics_px
  std::optional<std::array<int, 4>> crop_px;           ///< u, v, width, height: what the device is to send
  std::filesystem::path record_oni;                    ///< the runtime records to this file as well; empty: no
};

/// Every OpenNI2 device plugged in now; empty when there is none. The error says that the runtime has no driver.
Expected<std::vector<DeviceDescription>> list_openni2_devices();

/// Opens a device (empty URI: the first one) and starts its depth stream, not mirrored (a device that mirrors all the
/// same is flipped back), not cropped unless asked. Without a calibration or numbers, intrinsics come from the field of
/// view, f rounded to 1e-3 px, with the principal point in the centre: OpenNI2 can't say more. They are those of the
/// frames, so of the cropped image where it is cropped.
/// Frames carry the device's own timestamps (one that went back: `corrupt`, once; a clock set anew goes on by the
/// host's), count from 0 by the device's index (a gap is counted in `dropped`) and own their pixels, so they may
/// outlive the source. `device_lost` is final; a device that stalls gives `timeout`.
Expected<std::unique_ptr<FrameSource>> open_openni2(const std::string& uri, const OpenNi2Options& options);

/// The same, opened again whenever it is lost (reconnect.hpp): at the same URI, or as the only device of its kind (the
/// URI without its place). `record_oni` goes on in files of their own: desk.oni, desk-2.oni …
Expected<std::unique_ptr<FrameSource>> open_openni2_reconnecting(const std::string& uri, const OpenNi2Options& options,
                                                                 const ReconnectOptions& reconnect = {});

/// Opens a `.oni` file as a recording: every frame in order, unmirrored, then `end_of_stream`; the runtime's own
/// reader. A file that is cut, empty or no `.oni` is refused. One that stops in the middle ends with a `corrupt` frame:
/// it is damaged there. The runtime's decoder does not check what it reads, so it runs in a process of its own where
/// the program `tubetrack_oni_reader` lies beside the running one: when it crashes, opening fails, or the file ends
/// with `device_lost`. Of the options only intrinsics_px can be asked of a file.
Expected<std::unique_ptr<FrameSource>> open_oni_file(const std::filesystem::path& path, const OpenNi2Options& options);

}  // namespace tubetrack
