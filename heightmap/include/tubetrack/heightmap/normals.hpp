#pragma once

#include <array>
#include <vector>

#include "tubetrack/heightmap/height_map.hpp"
#include "tubetrack/heightmap/surfel.hpp"

namespace tubetrack {

/// How surfels are found in a height map.
struct SurfelOptions {
  double radius_min_m = 0.005;
  double radius_max_m = 0.100;
  double gate_sigmas = 4.0;  ///< curvature over its own σ, above which a surfel may be a tube's
};

/// Half sizes of the square windows, in pixels: 7, 13 and 21 px across.
inline constexpr std::array<int, 3> kWindowHalfSizes_px{3, 6, 10};

/// A least-squares plane w = a·x + b·y + c over a window, w the inverse depth, (x, y) the ray; (a, b, c) is along the
/// inward normal and 1/|(a, b, c)| is the plane's distance from the camera.
struct WindowPlane {
  Eigen::Vector3f inward_normal = Eigen::Vector3f::Zero();  ///< zero where there is no plane
  Eigen::Vector3f position_m = Eigen::Vector3f::Zero();
  float angle_sigma_rad = 0.0F;  ///< of the normal, about one axis
};

/// Planes over windows of half size `half_px`, one a cell, only where the window stays on one side of depth edges.
/// `edge_distance_px`: see `edge_distances`.
std::vector<WindowPlane> window_planes(const HeightMap& map, int half_px,
                                       const std::vector<std::uint8_t>& edge_distance_px);

/// Chessboard distance from each cell to the nearest depth edge or image border, capped at 255. A depth edge is a jump
/// between neighbours (also across a gap without returns) that neither the noise nor a grazing surface explains.
std::vector<std::uint8_t> edge_distances(const HeightMap& map, const NoiseModel& noise);

/// Surfels of everything curved like a tube of the wanted radii: each cell with the largest window that fits, gated on
/// convex curvature over its σ, with the band of radii that this curvature allows. In cell order.
std::vector<Surfel> tube_surfels(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options);

}  // namespace tubetrack
