#include "tubetrack/heightmap/normals.hpp"

#include <algorithm>
#include <iterator>
#include <optional>

#include "strips.hpp"
#include "tiles.hpp"

namespace tubetrack {

struct SurfelFinder::State {
  SurfelWork work;
  TileLedger tiles;
  std::optional<SurfelRule> rule;  ///< of the last frame
  std::optional<EdgeRule> edge_rule;
  Part rows;
  std::vector<Surfel> surfels;
  StripWork strips;
  std::vector<Surfel> with_strips;
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

Part wanted_rows(const HeightMap& map, const SurfelOptions& options) {
  const int height = map.intrinsics.height;
  const int begin = std::clamp(options.v_begin, 0, height);
  return {begin, std::clamp(options.v_end, begin, height)};
}

void list_surfels(const SurfelWork& work, const Part& rows, std::span<const std::uint8_t> skip,
                  std::vector<Surfel>& out) {
  const Grid& grid = work.heights.grid;
  out.clear();
  for (int v = rows.begin; v < rows.end; ++v) {
    fetch_found(work, v + 4);
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

void SurfelFinder::make_room(const HeightMap& map, const Workers& workers) {
  State& s = *state_;
  const Grid& grid = s.work.heights.grid;
  const auto threads = static_cast<std::size_t>(workers.count());
  const bool same_size = grid.width == map.intrinsics.width && grid.height == map.intrinsics.height;
  if (same_size && s.work.bands.size() >= threads) return;
  prepare(map, workers.count(), s.work);
  s.tiles.start(map);
  s.surfels.reserve(map.rays.size());
  s.with_strips.reserve(map.rays.size());
}

std::span<const Surfel> SurfelFinder::find(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options,
                                           std::span<const std::uint8_t> skip, Workers& workers) {
  State& s = *state_;
  make_room(map, workers);
  const SurfelRule rule(map.intrinsics, s.work.longest_ray2, noise, options);
  const EdgeRule edge_rule(noise, map.intrinsics.fx_px);
  const Part rows = wanted_rows(map, options);
  // What is kept is so of the rows that were wanted alone.
  if (s.rule != rule || s.edge_rule != edge_rule || s.rows != rows) s.tiles.forget();
  s.rule = rule;
  s.edge_rule = edge_rule;
  s.rows = rows;
  const std::span<const Region> regions = s.tiles.take_due(map, s.work.heights, workers, options.in_turns);
  find_in_regions(rule, edge_rule, regions, s.tiles.affected(), rows, s.work, workers);
  list_surfels(s.work, rows, skip, s.surfels);
  if (options.widest_strip_px <= 0.0) {
    s.strips.widest_px = 0.0;  // its runs are not kept up to date
    return s.surfels;
  }
  // Where there are both, what the surface itself says counts.
  const auto strips = strip_surfels(map, s.work.heights, s.work.fits.edges, rows, rule.noise, options, skip,
                                    !regions.empty(), s.strips);
  if (strips.empty()) return s.surfels;
  s.with_strips.clear();
  std::ranges::set_union(s.surfels, strips, std::back_inserter(s.with_strips), {}, &Surfel::cell, &Surfel::cell);
  return s.with_strips;
}

std::span<const Surfel> SurfelFinder::find(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options,
                                           std::span<const std::uint8_t> skip) {
  Workers alone(1);
  return find(map, noise, options, skip, alone);
}

std::vector<Surfel> tube_surfels(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options) {
  SurfelFinder finder;
  const auto surfels = finder.find(map, noise, options);
  return {surfels.begin(), surfels.end()};
}

}  // namespace tubetrack
