#pragma once

#include <vector>

#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/replay/scan_file.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack {

/// A face between a voxel of the body and one that is not.
struct BoundaryFace {
  Eigen::Vector3i twice;  ///< the centre's place in the grid, in half voxels
  int shape;              ///< which of a voxel's six faces: those of a grid are alike
};

/// In the order of their voxels. What lies outside the grid is not known, so the grid's border makes no faces.
std::vector<BoundaryFace> boundary_faces(const VoxelGrid& grid);

/// Unit outward normals of the faces: the faces' own, averaged over a ball with Gaussian weights (σ half the radius),
/// which is the gradient of the smoothed body.
std::vector<Eigen::Vector3f> smoothed_normals(const VoxelGrid& grid, const std::vector<BoundaryFace>& faces,
                                              double radius_m);

/// How normals are estimated: the method, and how far around a place.
struct NormalWindow {
  GridNormals method = GridNormals::smoothed;
  double radius_m = 0.0;
};

/// A surfel a boundary face. Its weight is the face's area as the surface runs
/// through it: the faces of a slanted surface are more than its area.
void add_voxel_surfels(const VoxelGrid& grid, const NormalWindow& window, std::vector<ScanSurfel>& surfels);

/// A surfel a cell: least-squares planes over the square of ± radius_m around it. Neighbours that rise more steeply
/// than 75° from the cell are on the far side of an edge and left out; cells with fewer than half of their neighbours
/// have no surfel. With the Voronoi measure cells that are steeper than 75° have none.
void add_height_surfels(const HeightGrid& grid, const NormalWindow& window, std::vector<ScanSurfel>& surfels);

}  // namespace tubetrack
