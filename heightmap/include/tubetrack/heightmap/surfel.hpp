#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace tubetrack {

/// An oriented surface element: what votes in the accumulation map. Metres, in the tracker's frame (camera, or world
/// where poses are known).
struct Surfel {
  Eigen::Vector3f position_m = Eigen::Vector3f::Zero();
  Eigen::Vector3f inward_normal = Eigen::Vector3f::UnitZ();  ///< unit, pointing away from the sensor
  float weight = 1.0F;
  float sigma_m = 0.001F;     ///< of the position, along the normal
  float radius_min_m = 0.0F;  ///< the surface's own curvature allows a tube of radius_min_m to radius_max_m
  float radius_max_m = 0.0F;
  std::uint32_t cell = 0;  ///< the height-map cell it came from
};

/// What a static scan has in its place, of which it may have ten million: neither gated nor refined.
struct ScanSurfel {
  Eigen::Vector3f position_m = Eigen::Vector3f::Zero();
  Eigen::Vector3f inward_normal = Eigen::Vector3f::UnitZ();  ///< unit, into the body
  float weight = 1.0F;                                       ///< the area it stands for, in squares of the grid step
};

}  // namespace tubetrack
