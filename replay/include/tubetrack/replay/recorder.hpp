#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/sensors/frame_source.hpp"

namespace tubetrack {

/// Writes a recording in TUM form, bit for bit what it is given. At every moment the folder is a readable recording of
/// the frames written so far: a frame is listed only once its image is complete.
class Recorder {
 public:
  /// Makes the folder and writes camera_info.yaml. A folder that holds an earlier recording of ours is emptied of it;
  /// one that holds anything else is refused (Error::usage).
  static Expected<Recorder> create(const std::filesystem::path& folder, const StreamInfo& info);

  /// Writes depth/NNNNNN.png, then its line in depth.txt and, when the frame has a pose, in groundtruth.txt. Frames are
  /// numbered in the order they come. The frame must have the size and unit of `info`. Error::failed (disk full, …)
  /// names the file and leaves the frames before readable.
  Expected<void> write(const DepthFrame& frame);

  std::int64_t frames_written() const { return frames_written_; }

 private:
  Recorder() = default;
  Expected<void> append(std::ofstream& file, const char* name, const std::string& text);

  std::filesystem::path folder_;
  StreamInfo info_;
  std::ofstream depth_list_;
  std::ofstream pose_list_;  ///< opened with the first pose
  std::int64_t frames_written_ = 0;
};

}  // namespace tubetrack
