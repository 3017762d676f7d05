#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "tubetrack/heightmap/height_map.hpp"

namespace tubetrack {

/// The points p with normal · p = distance_m, in the camera's frame; the normal (unit) points away from the camera.
struct SupportPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double distance_m = 0.0;
};

/// The plane that fills most of the picture: each small square of the image proposes the plane through its readings,
/// the one that most others lie in is fitted to all of them. Empty where none holds a tenth of the squares.
std::optional<SupportPlane> largest_plane(const HeightMap& map);

/// The metric grid of DESIGN §2: heights over a support plane, seen from above (orthographic), row-major. The frame of
/// the plane has its origin in the plane, x to the camera's right along it, y down, z away from the camera; a height is
/// −z. Cell (col, row) is around x = (first_col + col + 0.5) cell_m, y likewise.
struct PlaneMap {
  Eigen::Isometry3d world_from_plane = Eigen::Isometry3d::Identity();
  double cell_m = 0.0;
  int first_col = 0, first_row = 0, width = 0, height = 0;
  std::vector<float> height_m;       ///< mean over the frames that agreed; NaN: none
  std::vector<std::uint16_t> count;  ///< of those frames
  std::vector<std::uint8_t> trust;   ///< up with a frame that agrees, down with one that does not
};

/// Heights below and above these are left out: what is under the plane does not stand on it.
inline constexpr double kLowest_m = -0.02;
inline constexpr double kHighest_m = 0.60;

/// An empty map over a plane seen by a camera in a pose. `cell_m` 0: what a pixel sees of the plane, in steps of 0.1
/// mm.
PlaneMap make_plane_map(const SupportPlane& plane, const Eigen::Isometry3d& world_from_camera, const HeightMap& seen,
                        double cell_m);

/// Takes one frame's own readings in; the map grows where they lie beyond it (to 4096 cells either way, what is beyond
/// that is left out). In a frame the nearest surface wins a cell, the mean of its readings, but for those
/// beside a depth edge, which may be mixtures; over the frames heights
/// that agree within noise are averaged, and a height gives way when it was contradicted as often as confirmed.
void fuse(PlaneMap& map, const HeightMap& frame, const NoiseModel& noise, const Eigen::Isometry3d& world_from_camera);

}  // namespace tubetrack
