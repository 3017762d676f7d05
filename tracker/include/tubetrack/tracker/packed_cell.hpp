#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tubetrack {

/// The cell of a grid that a point lies in, as one number: 21 bits an axis, x lowest. What lies farther out than a
/// million cells is put into the outermost.
inline std::uint64_t packed_cell(const Eigen::Vector3d& point_m, double cell_m) {
  constexpr double kHalf = 1 << 20;
  std::uint64_t key = 0;
  for (Eigen::Index axis = 2; axis >= 0; --axis) {
    const double at = std::clamp(std::floor(point_m[axis] / cell_m), -kHalf, kHalf - 1.0);
    key = (key << 21) | static_cast<std::uint64_t>(at + kHalf);
  }
  return key;
}

}  // namespace tubetrack
