#pragma once

#include <span>
#include <vector>

#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/replay/scan_file.hpp"

namespace tubetrack {

/// How the normals of voxels and height maps are estimated; docs/paper.md compares them.
enum class GridNormals {
  smoothed,  ///< faces averaged over a ball (voxels), least-squares planes (height maps)
  voronoi    ///< the Voronoi covariance measure, as in the paper (section 3)
};

/// How surfels are made of a scan.
struct ScanSurfelOptions {
  /// Half size of what a voxel's or height-map cell's normal is taken over; at most about the tube's radius. 0: four
  /// grid steps for voxels, three for height maps.
  double normal_radius_m = 0.0;
  GridNormals normals = GridNormals::smoothed;
  std::size_t max_count = 5'000'000;  ///< large faces are cut into pieces only as far as this allows
};

/// The scan's oriented surface, in its frame; `inward_normal` points into the body, toward a tube's axis. The weight is
/// the element's area over the square of the grid step, about 1 on average (paper, section 2.3: forces weighted by face
/// area); a cloud's points weigh 1. A face larger than two grid steps gives several surfels that share its area. Empty
/// for an empty scan.
std::vector<ScanSurfel> surfels_of(const Scan& scan, const ScanSurfelOptions& options = {});

/// Radii that a scan can show.
struct RadiusRange {
  double min_m = 0.0;
  double max_m = 0.0;
};

/// From what it just resolves (for a mesh the median of the faces' shortest edges, as a section of few sides has one;
/// two grid steps for voxels and height maps, one and a half for clouds) to a quarter of its diagonal.
RadiusRange default_radius_range(const Scan& scan, std::span<const ScanSurfel> surfels);

}  // namespace tubetrack
