#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "scan_grid.hpp"
#include "scan_votes.hpp"

namespace tubetrack {

/// A scan's surfels at one size of cells.
struct ScanLevel {
  SurfelGrid grid;
  double spacing_m = 0.0;  ///< how far apart its surfels are
};

/// From coarse to fine. Those down to about the grid step hold all of the surface; what is finer says more of small
/// tubes alone, and holds what may be of one by then.
struct ScanLevels {
  std::span<const ScanSurfel> surfels;
  double grid_step_m = 0.0;
  std::vector<ScanLevel> all;
  std::size_t whole = 0;       ///< so many hold all of the surface
  std::vector<char> left_out;  ///< flags of the scan's surfels that finer ones do without; empty before there are any
};

/// The levels that hold all of the surface, at least one, for octaves from the largest on. `surfels` must outlive them.
ScanLevels levels_of(std::span<const ScanSurfel> surfels, const std::vector<Octave>& octaves, double grid_step_m);

/// Goes on to the level of an octave: `certain` has a level's flags of tubes that are beyond doubt, for all so far
/// (none at first). A level that is finer than those of all of the surface is made without them, and without what is
/// flat far and wide.
void go_to_level_of(const Octave& octave, std::vector<std::vector<char>>& certain, ScanLevels& levels);

/// The coarsest level, of those down to `finest`, whose cells are at most such a part of a radius; `finest` where none
/// is.
std::size_t level_to_fit(double radius_m, double most_radii, std::size_t finest, const ScanLevels& levels);

}  // namespace tubetrack
