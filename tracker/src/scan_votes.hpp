#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "scan_grid.hpp"
#include "tubetrack/tracker/accumulation_map.hpp"

namespace tubetrack {

/// Votes for radii from radius_min_m to about twice that: one such map for each octave of radii costs a handful of
/// votes a surfel, where one for all radii would cost hundreds.
struct Octave {
  double radius_min_m = 0.0;
  double radius_max_m = 0.0;
  double cell_m = 0.0;  ///< of the map, and of the grid of its surfels
};

/// Octaves of radii, the largest first. `cell_m`: of every map; empty: by the radius.
std::vector<Octave> octaves_of(double radius_min_m, double radius_max_m, double grid_step_m,
                               std::optional<double> cell_m);

/// A surfel's vote, weighted by the area it stands for: quarters of a cell's face, at least one. With the paper's face
/// areas (end of its section 2.3) irregular meshes vote as evenly as regular ones.
VoteRecord weighted_record(const CellSurfel& surfel, const Octave& octave, double grid_step_m);
inline constexpr int kVotesPerCell = 4;

/// Where a tube may be: traced from a peak.
struct ScanSeed {
  std::vector<Eigen::Vector3d> line_m;  ///< at least 2 points
  double radius_m = 0.0;
  bool closed = false;   ///< the last point is next to the first
  bool certain = false;  ///< the surface around it is seen from all sides, and is round beyond doubt
};

/// Traces from a peak (paper, algorithm 2), so many steps both ways, or once around where the line comes back to its
/// start. Nothing where the votes around the peak cannot be those of a tube.
std::optional<ScanSeed> seed_at(const AccumulationMap& votes, const VoxelIndex& peak, const Octave& octave,
                                int max_steps);

/// Flags of surfels that lie on something too flat for a tube of an octave's radii, and need not vote: all around, in a
/// bucket, which is as large as the smallest radius or twice that, normals point the same way, to 2°, where those of
/// the largest tube spread over 26°. Most of a scan may be floor.
std::vector<char> flat_surfels(const SurfelGrid& grid);

/// Of those, the ones whose bucket has nothing but flat ones around it: they are not near a tube of those radii, or
/// smaller ones, either.
std::vector<char> flat_around(const SurfelGrid& grid);

}  // namespace tubetrack
