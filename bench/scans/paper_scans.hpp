#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "tubetrack/replay/scan_file.hpp"
#include "tubetrack/tracker/part_chain.hpp"

namespace tubetrack::bench {

/// A scan like one of the paper's (its fig. 7), and what the paper says of it.
struct PaperScan {
  std::string name;
  Scan scan;
  PartChain truth;  ///< the centreline
  double radius_m = 0.0;
  std::size_t paper_faces = 0;
  double paper_s = std::numeric_limits<double>::quiet_NaN();
  double goal_voxels = std::numeric_limits<double>::quiet_NaN();  ///< of the RMS distance to the true centreline
};

/// Full and partial mesh, reduced area, digital object, height map, and the tube that the paper decomposes: as many
/// faces as there, the radius as many grid steps. `times` scales the number of faces.
std::vector<PaperScan> paper_scans(double times);

/// Of the robustness figure (its fig. 4): noise, holes, low resolution, a sector of the section.
std::vector<PaperScan> robustness_scans(double times);

/// A full mesh of so many faces: a tube of radius 6 steps, as long as that takes.
PaperScan mesh_of_faces(std::size_t faces);

/// Faces of a mesh, boundary faces of voxels, cells of a height map.
std::size_t faces_of(const Scan& scan, std::size_t surfels);

}  // namespace tubetrack::bench
