#pragma once

// Between a program that reads an .oni file and the process that decodes it (tubetrack_oni_reader): both are of one
// build, so plain data goes over as it lies in memory. First a request, then what came of it, then frame after frame.
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>

#include "tubetrack/sensors/openni2_source.hpp"

namespace tubetrack {

/// Followed by the path.
struct OniRequest {
  bool has_intrinsics = false;
  std::array<double, 4> intrinsics_px = {};
  std::uint32_t path_bytes = 0;
};

/// Followed by the error's message, where there is one.
struct OniOpened {
  Intrinsics intrinsics;
  double metres_per_unit = 0.0;
  std::int64_t frame_count = 0;
  std::uint32_t error_bytes = 0;
};

/// Followed by the problem, then by the pixels, row after row, where the outcome is ok.
struct OniFrame {
  FrameOutcome outcome = FrameOutcome::ok;
  std::int64_t index = 0;
  double timestamp_s = 0.0;
  std::uint32_t problem_bytes = 0;
};

/// open_oni_file, decoded in this process: for that one.
Expected<std::unique_ptr<FrameSource>> open_oni_file_here(const std::filesystem::path& path,
                                                          const OpenNi2Options& options);

}  // namespace tubetrack
