#pragma once

#include <Eigen/Geometry>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

namespace tubetrack {

/// A borrowed view of one depth image. `keep_alive` owns the pixels where the frame outlives the call (queue, recorder,
/// callback) and is empty when the caller owns them.
struct DepthFrame {
  const std::uint16_t* pixels = nullptr;  ///< row-major; 0 is "no return"
  int width = 0;
  int height = 0;
  std::size_t stride_bytes = 0;
  double metres_per_unit = 0.001;
  double timestamp_s = 0.0;                                 ///< the device's clock (live) or the recording's
  std::chrono::steady_clock::time_point received = {};      ///< live: when it arrived, on the host's clock
  std::int64_t index = 0;                                   ///< counted by the source, from 0
  std::optional<Eigen::Isometry3d> world_from_camera = {};  ///< empty: no poses, or (pose_missing) none near enough
  bool pose_missing = false;                                ///< the source has poses, but none within 20 ms
  std::shared_ptr<const void> keep_alive = {};

  const std::uint16_t* row(int v) const {
    return reinterpret_cast<const std::uint16_t*>(reinterpret_cast<const std::byte*>(pixels) +
                                                  static_cast<std::size_t>(v) * stride_bytes);
  }
};

}  // namespace tubetrack
