#pragma once

#include <Eigen/Core>
#include <vector>

#include "ray_cast.hpp"
#include "tubetrack/sensors/intrinsics.hpp"

namespace tubetrack {

/// First hits of one ray a pixel, row-major. The ray's direction is (x, y, 1), so t is depth z.
struct CastImage {
  std::vector<double> depth_m;  ///< infinite: nothing hit
  std::vector<int> primitive;   ///< −1: nothing hit
};

/// (x/z, y/z) a pixel; `stray_px` is how far they may lie from the pixels' own rays.
CastImage cast_image(const std::vector<Primitive>& primitives, const Intrinsics& camera,
                     const std::vector<Eigen::Vector2d>& rays, double stray_px);

/// Marks (1) the pixels whose hit point can't be seen from `projector_m`, because something lies between.
std::vector<unsigned char> shadow_mask(const std::vector<Primitive>& primitives,
                                       const std::vector<Eigen::Vector2d>& rays, const CastImage& hits,
                                       const Eigen::Vector3d& projector_m);

}  // namespace tubetrack
