#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/sensors/intrinsics.hpp"

namespace tubetrack {

/// What a ROS camera_info.yaml says. The values are as written: validate() decides once it is known that they are used.
struct CameraInfo {
  Intrinsics intrinsics;
  std::optional<double> metres_per_unit;  ///< our extra key `depth_scale`
};

/// Reads image_width, image_height, camera_matrix.data, distortion_model, distortion_coefficients.data, depth_scale.
/// The error names the file and the field that is missing or of the wrong kind.
Expected<CameraInfo> read_camera_info(const std::filesystem::path& path);

/// The text of a camera_info.yaml; read back it gives the same doubles.
std::string camera_info_yaml(const Intrinsics& intrinsics, double metres_per_unit);

}  // namespace tubetrack
