#pragma once

#include <filesystem>
#include <memory>

#include "tubetrack/replay/recording.hpp"

namespace tubetrack {

/// Opens a .oni file: range and pace by the options; a depth scale is refused, as the file says its own. In a build
/// without OpenNI2 the error names the package.
Expected<std::unique_ptr<FrameSource>> open_oni_recording(const std::filesystem::path& path,
                                                          const RecordingOptions& options);

}  // namespace tubetrack
