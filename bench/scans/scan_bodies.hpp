#pragma once

#include <random>
#include <vector>

#include "tubetrack/replay/scan_file.hpp"
#include "tubetrack/tracker/part_chain.hpp"

namespace tubetrack::bench {

/// How the surface of a tube is scanned. Lengths in metres.
struct ScanOfTube {
  double radius_m = 0.006;
  double step_m = 0.001;
  double section_rad = 6.283185307179586;  ///< of the section, around where `seen_from` is
  Eigen::Vector3d seen_from = -Eigen::Vector3d::UnitZ();
  double noise_m = 0.0;  ///< σ of the points, along the surface's normal
  bool closed = false;   ///< the chain's end is its start: no ends are left open
  /// Only the faces that look toward `seen_from`, by the tube's own normal: half of every section, with what lies in
  /// front of it looked through.
  bool one_side = false;
};

/// The surface as triangles of about two a square of the step; the tube's ends are open. A half-seen section faces
/// `seen_from` as far as the tube's direction lets it.
Scan mesh_of_tube(const PartChain& chain, const ScanOfTube& how, std::mt19937_64& random);

/// The voxels whose centres are inside the tube, of edge step_m; ends are rounded off.
Scan voxels_of_tube(const PartChain& chain, const ScanOfTube& how);

/// Heights of the tube over the plane z = 0, seen along +z; nothing around it.
Scan heights_of_tube(const PartChain& chain, const ScanOfTube& how);

/// The distance of a point from the chain's line.
double distance_from(const std::vector<Eigen::Vector3d>& line_m, const Eigen::Vector3d& point_m);

/// RMS of a line's points to the chain, and the largest distance.
struct LineError {
  double rms_m = 0.0;
  double max_m = 0.0;
};
LineError error_of(const std::vector<Eigen::Vector3d>& nodes_m, const PartChain& chain);

}  // namespace tubetrack::bench
