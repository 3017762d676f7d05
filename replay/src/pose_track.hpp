#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// A pose farther than this from a frame's stamp says nothing about the frame.
inline constexpr double kPoseLimit_s = 0.020;

/// Where the camera was at one moment: world_from_camera, metres, unit quaternion.
struct StampedPose {
  double timestamp_s = 0.0;
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
};

/// Reads groundtruth.txt (`timestamp tx ty tz qx qy qz qw`, world_from_camera) and sorts it by time. The error names
/// the line; a last line cut short by a killed writer is left out.
Expected<std::vector<StampedPose>> read_pose_track(const std::filesystem::path& path);

/// world_from_camera at a moment: between its two neighbours (slerp, lerp), or the outermost pose beyond the ends.
/// Empty when no pose lies within kPoseLimit_s. At a pose's own stamp it is exactly that pose. `track` sorted by time.
std::optional<Eigen::Isometry3d> pose_at(std::span<const StampedPose> track, double timestamp_s);

}  // namespace tubetrack
