#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tubetrack/replay/camera_info.hpp"
#include "tubetrack/replay/recording.hpp"

namespace tubetrack {

/// Stamps of recordings that carry none are counted at this rate.
inline constexpr double kAssumedFramesPerSecond = 30.0;

/// One frame as a recording lists it; its image is not opened yet.
struct RecordedFrame {
  std::filesystem::path image;
  double timestamp_s = 0.0;
  std::optional<Eigen::Isometry3d> world_from_camera;
  std::string listed_in;  ///< where the stamp stands, for messages: "…/depth.txt:12"
};

/// What a recording's files say before anything is checked: what each format's reader returns.
struct RecordedSequence {
  std::filesystem::path path;
  std::vector<RecordedFrame> frames;
  std::optional<CameraInfo> camera;   ///< image size 0 × 0 where the format does not tell it
  std::filesystem::path camera_file;  ///< where `camera` was read, or would be
  bool has_poses = false;
  std::vector<std::string> notes;
};

/// A folder with depth.txt. Error::failed names file, line and fix.
Expected<RecordedSequence> read_tum_recording(const std::filesystem::path& folder);

/// A folder of depth images in natural order (or one image file), with camera_info.yaml if it is there.
Expected<RecordedSequence> read_image_folder(const std::filesystem::path& folder_or_image);

/// A BOP scene: scene_camera.json and depth/NNNNNN.png (or .tif). Lengths in the file are millimetres.
Expected<RecordedSequence> read_bop_recording(const std::filesystem::path& folder);

/// Plays frames [first, last) of the sequence. `info` holds the checked intrinsics, scale and name.
std::unique_ptr<FrameSource> play_sequence(std::vector<RecordedFrame> frames, StreamInfo info, std::int64_t first,
                                           std::int64_t last, Pace pace);

}  // namespace tubetrack
