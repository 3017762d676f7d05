#include "scan_levels.hpp"

#include <algorithm>
#include <utility>

namespace tubetrack {

ScanLevels levels_of(std::span<const ScanSurfel> surfels, const std::vector<Octave>& octaves, double grid_step_m) {
  constexpr double kWholeSteps = 1.1;
  ScanLevels levels{surfels, grid_step_m, {}, 0, {}};
  std::vector<double> cells_m;
  for (const Octave& octave : octaves) {
    if (!cells_m.empty() && octave.cell_m < kWholeSteps * grid_step_m) break;
    if (cells_m.empty() || octave.cell_m < cells_m.back()) cells_m.push_back(octave.cell_m);
  }
  levels.whole = cells_m.size();
  levels.all.resize(cells_m.size());
  for (std::size_t i = cells_m.size(); i-- > 0;) {
    ScanLevel& level = levels.all[i];
    level.grid = i + 1 == cells_m.size() ? merged_by_cell(surfels, {}, cells_m[i])
                                         : merged_by_cell(levels.all[i + 1].grid.surfels, cells_m[i]);
    level.spacing_m = std::max(cells_m[i], grid_step_m);
  }
  return levels;
}

void go_to_level_of(const Octave& octave, std::vector<std::vector<char>>& certain, ScanLevels& levels) {
  if (certain.empty()) certain.emplace_back(levels.all[0].grid.surfels.size(), 0);
  while (levels.all[certain.size() - 1].grid.cell_m > octave.cell_m) {
    const SurfelGrid& coarser = levels.all[certain.size() - 1].grid;
    std::vector<char> flags = certain.back();
    if (certain.size() < levels.whole) {
      const SurfelGrid& finer = levels.all[certain.size()].grid;
      certain.emplace_back(finer.surfels.size(), 0);
      flag_members(coarser, flags, finer.surfels, certain.back());
      continue;
    }
    const std::vector<char> flat = flat_around(coarser);
    for (std::size_t i = 0; i < flags.size(); ++i) flags[i] = static_cast<char>(flags[i] | flat[i]);
    levels.left_out.resize(levels.surfels.size(), 0);
    flag_members(coarser, flags, levels.surfels, levels.left_out);
    ScanLevel level;
    level.grid = merged_by_cell(levels.surfels, levels.left_out, octave.cell_m);
    level.spacing_m = levels.grid_step_m;
    certain.emplace_back(level.grid.surfels.size(), 0);
    levels.all.push_back(std::move(level));
  }
}

std::size_t level_to_fit(double radius_m, double most_radii, std::size_t finest, const ScanLevels& levels) {
  std::size_t level = 0;
  while (level < finest && levels.all[level].grid.cell_m > most_radii * radius_m) ++level;
  return level;
}

}  // namespace tubetrack
