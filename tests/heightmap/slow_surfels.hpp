#pragma once

#include <vector>

#include "tubetrack/heightmap/normals.hpp"

namespace tubetrack {

/// A least-squares plane w = a·x + b·y + c over a window, w the inverse depth, (x, y) the ray; (a, b, c) is along the
/// inward normal and 1/|(a, b, c)| is the plane's distance from the camera.
struct WindowPlane {
  Eigen::Vector3d inward_normal = Eigen::Vector3d::Zero();  ///< zero where there is no plane
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  double angle_sigma_rad = 0.0;  ///< of the normal, about one axis
};

/// What `SurfelFinder` computes, cell by cell in doubles: each window summed on its own.
std::vector<WindowPlane> slow_window_planes(const HeightMap& map, int half_px,
                                            const std::vector<std::uint8_t>& edge_distance_px);

/// Chessboard distance from each cell to the nearest depth edge or image border, capped at 255.
std::vector<std::uint8_t> slow_edge_distances(const HeightMap& map, const NoiseModel& noise);

std::vector<Surfel> slow_tube_surfels(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options);

}  // namespace tubetrack
