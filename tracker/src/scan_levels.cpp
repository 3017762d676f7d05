#include "scan_levels.hpp"

#include <algorithm>
#include <utility>

namespace tubetrack {

namespace {

/// Flags of what a level was made of, from those of the level itself.
std::vector<char> flags_of_finer(const ScanLevel& level, const std::vector<char>& flags) {
  std::vector<char> finer(level.merged_into.size(), 0);
  for (std::size_t i = 0; i < finer.size(); ++i) {
    if (level.merged_into[i] != kNotMerged) finer[i] = flags[level.merged_into[i]];
  }
  return finer;
}

}  // namespace

ScanLevels levels_of(std::span<const ScanSurfel> surfels, const std::vector<Octave>& octaves, double grid_step_m) {
  constexpr double kWholeSteps = 1.1;
  ScanLevels levels{surfels, grid_step_m, {}, 0, std::vector<char>(surfels.size(), 0)};
  std::vector<double> cells_m;
  for (const Octave& octave : octaves) {
    if (!cells_m.empty() && octave.cell_m < kWholeSteps * grid_step_m) break;
    if (cells_m.empty() || octave.cell_m < cells_m.back()) cells_m.push_back(octave.cell_m);
  }
  levels.whole = cells_m.size();
  levels.all.resize(cells_m.size());
  for (std::size_t i = cells_m.size(); i-- > 0;) {
    ScanLevel& level = levels.all[i];
    level.grid = i + 1 == cells_m.size()
                     ? merged_by_cell(surfels, {}, cells_m[i], level.merged_into)
                     : merged_by_cell(levels.all[i + 1].grid.surfels, cells_m[i], level.merged_into);
    level.spacing_m = std::max(cells_m[i], grid_step_m);
  }
  return levels;
}

void go_to_level_of(const Octave& octave, std::vector<std::vector<char>>& certain, ScanLevels& levels) {
  if (certain.empty()) certain.emplace_back(levels.all[0].grid.surfels.size(), 0);
  while (levels.all[certain.size() - 1].grid.cell_m > octave.cell_m) {
    const ScanLevel& coarser = levels.all[certain.size() - 1];
    std::vector<char> finer = flags_of_finer(coarser, certain.back());
    if (certain.size() >= levels.whole) {
      // What this level was made of is the scan.
      const std::vector<char> flat = flags_of_finer(coarser, flat_around(coarser.grid));
      for (std::size_t i = 0; i < flat.size(); ++i) {
        if (flat[i] != 0 || finer[i] != 0) levels.left_out[i] = 1;
      }
      ScanLevel level;
      level.grid = merged_by_cell(levels.surfels, levels.left_out, octave.cell_m, level.merged_into);
      level.spacing_m = levels.grid_step_m;
      finer.assign(level.grid.surfels.size(), 0);
      levels.all.push_back(std::move(level));
    }
    // They have told what they are for.
    levels.all[certain.size() - 1].merged_into = {};
    certain.push_back(std::move(finer));
  }
}

std::size_t level_to_fit(double radius_m, double most_radii, std::size_t finest, const ScanLevels& levels) {
  std::size_t level = 0;
  while (level < finest && levels.all[level].grid.cell_m > most_radii * radius_m) ++level;
  return level;
}

}  // namespace tubetrack
