#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tubetrack/sensors/frame_source.hpp"

namespace tubetrack {

/// Half-open range of frame numbers, `--frames A:B`.
struct FrameRange {
  std::int64_t begin = 0;
  std::optional<std::int64_t> end;
};

enum class Pace { fast, realtime };

/// What the command line knows about a recording and its files may not say.
struct RecordingOptions {
  std::optional<std::array<double, 4>> intrinsics_px;  ///< fx, fy, cx, cy
  std::optional<double> metres_per_unit;               ///< `--depth-scale`
  FrameRange frames;
  Pace pace = Pace::fast;
};

/// An opened recording, and what had to be assumed to open it (one line each, to be shown to the user).
struct OpenedRecording {
  std::unique_ptr<FrameSource> source;
  std::vector<std::string> notes;
};

/// Opens any recording of DESIGN §4: TUM folder, bare folder of 16-bit images, BOP scene, .oni file.
Expected<OpenedRecording> open_recording(const std::filesystem::path& path, const RecordingOptions& options);

}  // namespace tubetrack
