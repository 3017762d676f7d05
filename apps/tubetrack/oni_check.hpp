#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// Whether an .oni holds what was seen while it was recorded: OpenNI2's codec is not exact for every image.
class OniCheck {
 public:
  explicit OniCheck(std::filesystem::path path) : path_(std::move(path)), seen_(1) {}

  void add(const DepthFrame& frame);
  /// The device was lost: the next frame is in a file of its own.
  void next_piece() { seen_.emplace_back(); }

  /// Reads the closed files; a line for people. The error says which file can't be read.
  Expected<std::string> read_back() const;

 private:
  std::filesystem::path path_;
  std::vector<std::vector<std::uint64_t>> seen_;  ///< a hash a frame, for each file
};

}  // namespace tubetrack
