#pragma once

#include <memory>
#include <string>

#include "tubetrack/replay/recording.hpp"
#include "tubetrack/sensors/frame_source.hpp"

namespace tubetrack {

/// Opens a live device (empty: the first one) with what `options` say of intrinsics and frames: frames before the range
/// are passed over, after it the stream ends. Pace and depth scale are the device's own and refused (Error::usage). In
/// a build without OpenNI2 the error names the package.
Expected<std::unique_ptr<FrameSource>> open_device(const std::string& uri, const RecordingOptions& options);

/// One line about an open device for people: its mode and where its intrinsics come from.
std::string device_note(const StreamInfo& info, const RecordingOptions& options);

/// What a build without OpenNI2 says.
Error without_openni2();

}  // namespace tubetrack
