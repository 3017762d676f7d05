#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/tracker/accumulation_map.hpp"

namespace tubetrack {

/// One surfel for each cell of a grid: position and normal are means by weight. What a scan has more of than a vote
/// needs is taken together, so that the time depends on the surface alone and a normal is as smooth as the radii that
/// are looked for allow. Opposite walls of a thin plate in one cell cancel out. In the order of the cells.
std::vector<Surfel> merged_by_cell(std::span<const Surfel> surfels, double cell_m);

/// Votes for radii from radius_min_m to about twice that: one such map for each octave of radii costs a handful of
/// votes a surfel, where one for all radii would cost hundreds.
struct Octave {
  double radius_min_m = 0.0;
  double radius_max_m = 0.0;
  double cell_m = 0.0;          ///< of the map
  std::vector<Surfel> surfels;  ///< merged by it
};

/// Octaves of radii, the largest first. `cell_m`: of every map; empty: by the radius.
std::vector<Octave> octaves_of(std::span<const Surfel> surfels, double radius_min_m, double radius_max_m,
                               double grid_step_m, std::optional<double> cell_m);

/// A surfel's vote, weighted by the area it stands for: quarters of a cell's face, at least one. With the paper's face
/// areas (end of its section 2.3) irregular meshes vote as evenly as regular ones.
VoteRecord weighted_record(const Surfel& surfel, const Octave& octave, double grid_step_m);
inline constexpr int kVotesPerCell = 4;

/// Where a tube may be: traced from a peak.
struct ScanSeed {
  std::vector<Eigen::Vector3d> line_m;  ///< at least 2 points
  double radius_m = 0.0;
  bool closed = false;  ///< the last point is next to the first
};

/// Traces from a peak (paper, algorithm 2), both ways, or once around where the line comes back to its start. Nothing
/// where the votes around the peak cannot be those of a tube.
std::optional<ScanSeed> seed_at(const AccumulationMap& votes, const VoxelIndex& peak, const Octave& octave);

}  // namespace tubetrack
