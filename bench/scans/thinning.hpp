#pragma once

#include <cstddef>

#include "tubetrack/replay/scan_file.hpp"

namespace tubetrack::bench {

/// A curve skeleton by topological thinning, as in the paper's figure 2: voxels are peeled off from six sides in turn,
/// as long as the body's topology stays (simple points, 26-connected body, 6-connected background) and they end no
/// line. What is left has the body's pieces, tunnels and cavities.
VoxelGrid thinned(VoxelGrid grid);

/// Of a body of voxels, neighbours by corners.
struct Topology {
  std::size_t voxels = 0;
  std::size_t ends = 0;      ///< voxels with one neighbour: a clean line has two
  std::size_t pieces = 0;    ///< b0
  std::size_t loops = 0;     ///< b1: tunnels
  std::size_t cavities = 0;  ///< b2
};
Topology topology_of(const VoxelGrid& grid);

}  // namespace tubetrack::bench
