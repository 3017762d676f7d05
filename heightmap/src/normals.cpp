#include "tubetrack/heightmap/normals.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "surfel_region.hpp"

namespace tubetrack {

struct SurfelFinder::State {
  SurfelWork work;
  std::vector<Surfel> surfels;
};

namespace {

Surfel surfel_of(const FoundSurfel& found, std::size_t cell) {
  Surfel surfel;
  surfel.position_m = {found.x_m, found.y_m, found.z_m};
  surfel.inward_normal = {found.normal_x, found.normal_y, found.normal_z};
  surfel.sigma_m = found.sigma_m;
  surfel.radius_min_m = found.radius_min_m;
  surfel.radius_max_m = found.radius_max_m;
  surfel.cell = static_cast<std::uint32_t>(cell);
  return surfel;
}

void list_surfels(const SurfelWork& work, std::span<const std::uint8_t> skip, std::vector<Surfel>& out) {
  const Grid& grid = work.heights.grid;
  out.clear();
  for (int v = 0; v < grid.height; ++v) {
    const std::size_t row = static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width);
    const FoundSurfel* found = work.found.get() + row;
    for (int i = 0; i < work.found_count[static_cast<std::size_t>(v)]; ++i) {
      const std::size_t cell = row + static_cast<std::size_t>(found[i].u);
      if (skip.empty() || skip[cell] == 0) out.push_back(surfel_of(found[i], cell));
    }
  }
}

}  // namespace

SurfelFinder::SurfelFinder() : state_(std::make_unique<State>()) {}
SurfelFinder::SurfelFinder(SurfelFinder&&) noexcept = default;
SurfelFinder& SurfelFinder::operator=(SurfelFinder&&) noexcept = default;
SurfelFinder::~SurfelFinder() = default;

std::span<const Surfel> SurfelFinder::find(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options,
                                           std::span<const std::uint8_t> skip) {
  SurfelWork& work = state_->work;
  const int width = map.intrinsics.width;
  const int height = map.intrinsics.height;
  if (work.heights.grid.width != width || work.heights.grid.height != height) prepare(map, work);
  const SurfelRule rule(map.intrinsics, work.longest_ray2, noise, options);
  const EdgeRule edge_rule(noise, map.intrinsics.fx_px);
  for (int v = 0; v < height; ++v) take_heights(map, v, 0, width, work.heights);
  fit_windows(edge_rule, 0, height, work);
  find_in_region(rule, {0, (width + 31) / 32 * 32, 0, height}, work);
  list_surfels(work, skip, state_->surfels);
  return state_->surfels;
}

std::vector<Surfel> tube_surfels(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options) {
  SurfelFinder finder;
  const auto surfels = finder.find(map, noise, options);
  return {surfels.begin(), surfels.end()};
}

}  // namespace tubetrack
