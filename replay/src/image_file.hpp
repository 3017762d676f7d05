#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// A decoded depth image that owns its pixels.
struct DepthImage {
  const std::uint16_t* pixels = nullptr;  ///< row-major
  int width = 0;
  int height = 0;
  std::size_t stride_bytes = 0;
  std::shared_ptr<const void> owner;
};

/// Why an image is no depth image, in one line that begins with its path.
struct ImageProblem {
  enum class Kind {
    unreadable,  ///< missing, truncated, damaged
    wrong_type   ///< an intact image, but not 16-bit with a single channel
  };
  Kind kind = Kind::unreadable;
  std::string message;
};

/// Reads a 16-bit single-channel PNG, TIFF or PGM as it is: nothing is scaled or converted.
tl::expected<DepthImage, ImageProblem> read_depth_image(const std::filesystem::path& path);

/// True for the file names read_depth_image is meant for: .png .tif .tiff .pgm, in any case.
bool has_depth_image_extension(const std::filesystem::path& path);

/// Writes the frame's pixels as a 16-bit PNG under a temporary name, then renames: `path` is never half written.
Expected<void> write_depth_png(const std::filesystem::path& path, const DepthFrame& frame);

}  // namespace tubetrack
