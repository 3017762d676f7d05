#include "tubetrack/tracker/scan_tubes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "scan_grow.hpp"
#include "scan_levels.hpp"
#include "scan_result.hpp"
#include "scan_votes.hpp"
#include "stopwatch.hpp"

namespace tubetrack {

namespace {

constexpr int kMinScanVotes = 6 * kVotesPerCell;
constexpr int kMaxFailures = 64;  // of the seeds of one octave
// Cells of the surfels that a tube is grown on and fitted to at last, of its radius.
constexpr double kGrowCellRadii = 0.45, kFitCellRadii = 0.3;
// Cells of the surfels that vote, at most so large a part of the smallest radius that is looked for, and of their map,
// as a part of those: votes come together finer than they start.
constexpr double kVoteCellRadii = 0.6, kMapCells = 0.75;
constexpr double kKnownBand = 0.15;    // votes go so far to either side of a known radius
constexpr double kBelongsRadii = 0.3;  // what is so near to a tube's surface is no other's

/// Sets the flags of the surfels of a tube, and returns which were set.
std::vector<std::uint32_t> take(const ScanSurface& surface, const ScanTube& tube, std::vector<char>& taken) {
  std::vector<std::uint32_t> set;
  const double radius_m = tube.line.model.radius_m;
  const double belongs_m = std::max(kBelongsRadii * radius_m, surface.spacing_m);
  for (const SurfacePoint& point : points_near(surface.grid, taken, tube.line)) {
    if (std::abs(static_cast<double>(point.distance_m) - radius_m) > belongs_m || taken[point.surfel] != 0) continue;
    taken[point.surfel] = 1;
    set.push_back(point.surfel);
  }
  return set;
}

bool lies_near(const std::vector<Eigen::Vector3d>& points_m, const Eigen::Vector3d& point_m, double distance_m) {
  return std::any_of(points_m.begin(), points_m.end(), [&](const Eigen::Vector3d& other_m) {
    return (other_m - point_m).squaredNorm() < distance_m * distance_m;
  });
}

bool radius_in_range(double radius_m, const ScanTubesConfig& config) {
  return config.radius_m || (radius_m >= config.radius_min_m && radius_m <= config.radius_max_m);
}

ScanSurface surface_of(const ScanLevel& level, std::span<const char> taken) {
  return {level.grid, taken, level.spacing_m};
}

/// A tube of an octave's radii from a peak of its votes, grown on the coarsest level that shows it. `line_m` gets the
/// seed's.
std::optional<ScanTube> tube_at(const AccumulationMap& votes, const VoxelIndex& peak, const Octave& octave,
                                std::size_t finest, const ScanLevels& levels,
                                const std::vector<std::vector<char>>& taken, const ScanTubesConfig& config,
                                std::vector<Eigen::Vector3d>& line_m) {
  constexpr int kFirstSteps = 4, kMostSteps = 10'000'000;
  auto seed = seed_at(votes, peak, octave, kFirstSteps);
  if (!seed) return std::nullopt;
  // Most peaks of other radii are told by a short piece.
  line_m = seed->line_m;
  const std::size_t of_seed = level_to_fit(seed->radius_m, kGrowCellRadii, finest, levels);
  if (!fit_seed(surface_of(levels.all[of_seed], taken[of_seed]), octave, config, *seed)) return std::nullopt;
  auto whole = seed_at(votes, peak, octave, kMostSteps);
  if (!whole) return std::nullopt;
  whole->radius_m = seed->radius_m;
  whole->certain = seed->certain;
  line_m = whole->line_m;
  const std::size_t level = level_to_fit(whole->radius_m, kGrowCellRadii, finest, levels);
  auto tube = grow_scan_tube(surface_of(levels.all[level], taken[level]), *whole, config);
  if (!tube || !radius_in_range(tube->line.model.radius_m, config) ||
      !is_of_octave(tube->line.model.radius_m, octave, config))
    return std::nullopt;
  tube->level = level;
  return tube;
}

/// A cell holds more than a surfel of the scan or two.
bool holds_many(const ScanLevel& level, const ScanLevels& levels) {
  constexpr double kLeastSteps = 1.3;
  constexpr std::size_t kLeast = 3;
  return level.grid.cell_m >= kLeastSteps * levels.grid_step_m &&
         levels.surfels.size() >= kLeast * level.grid.surfels.size();
}

/// The level whose surfels vote: normals as smooth as the radii allow, and few; the octave's own where coarser cells
/// would hold little more than one surfel of the scan.
std::size_t voting_level(const Octave& octave, std::size_t own, const ScanLevels& levels) {
  const std::size_t coarse = level_to_fit(octave.radius_min_m, kVoteCellRadii, own, levels);
  return holds_many(levels.all[coarse], levels) ? coarse : own;
}

/// Whether an octave can do without a level of its own, which would hold nearly all of the scan again.
bool is_fine_enough(const ScanLevel& finest, const Octave& octave, const ScanLevels& levels) {
  constexpr double kFineEnoughRadii = 0.55;  // of the octave's smallest
  return finest.grid.cell_m <= kFineEnoughRadii * octave.radius_min_m && holds_many(finest, levels);
}

/// What looks like a tube of an octave's radii: from the best peak on, each of surfels that no earlier one has.
/// `certain` has a level's flags of tubes that are beyond doubt, for all up to the octave's, and gets those of more.
void search_octave(const Octave& octave, const ScanLevels& levels, const ScanTubesConfig& config,
                   std::vector<std::vector<char>>& certain, std::vector<ScanTube>& candidates, StageTimes& times) {
  Stopwatch watch;
  const std::size_t own = certain.size() - 1;
  const std::size_t voting = voting_level(octave, own, levels);
  const ScanLevel& level = levels.all[voting];
  Octave coarse = octave;
  coarse.cell_m = std::max(octave.cell_m, kMapCells * level.grid.cell_m);
  AccumulationMap votes(coarse.cell_m);
  std::vector<std::vector<char>> taken = certain;
  const std::vector<char> flat = flat_surfels(level.grid);
  const auto record_of = [&](std::size_t i) {
    return weighted_record(level.grid.surfels[i], coarse, config.grid_step_m);
  };
  // Votes that are not cast are not withdrawn either.
  std::vector<char> voted(level.grid.surfels.size(), 0);
  for (std::size_t i = 0; i < voted.size(); ++i) {
    if (taken[voting][i] != 0 || flat[i] != 0) continue;
    voted[i] = 1;
    votes.add(record_of(i));
  }
  watch.lap(times.accumulate_ms);
  const double near_m = std::max(2.0 * octave.cell_m, 0.3 * octave.radius_min_m);
  std::vector<Eigen::Vector3d> failed_m, line_m;
  int failures = 0;
  for (const VoxelIndex& peak : votes.peaks(kMinScanVotes, 1)) {
    if (failures >= kMaxFailures) break;
    if (votes.box_votes(peak, 1) < kMinScanVotes || lies_near(failed_m, votes.center_of(peak), near_m)) continue;
    watch.lap(times.trace_ms);
    line_m.clear();
    auto tube = tube_at(votes, peak, octave, own, levels, taken, config, line_m);
    if (tube) {
      const bool surely = is_certain(tube->evidence);
      for (std::size_t at = std::min(tube->level, voting); at <= own; ++at) {
        for (const std::uint32_t index : take(surface_of(levels.all[at], taken[at]), *tube, taken[at])) {
          if (surely) certain[at][index] = 1;
          if (at == voting && voted[index] != 0) votes.withdraw(record_of(index));
        }
      }
      candidates.push_back(std::move(*tube));
    } else if (!line_m.empty()) {
      ++failures;
      failed_m.insert(failed_m.end(), line_m.begin(), line_m.end());
      failed_m.push_back(votes.center_of(peak));
    }
    watch.lap(times.fit_ms);
  }
}

/// The surface that a tube explains, counted in surfels of the scan.
double explained(const ScanTube& tube) {
  double sum = 0.0;
  for (const ScanStation& station : tube.evidence.stations) {
    if (station.t >= tube.evidence.t_begin && station.t <= tube.evidence.t_end) sum += station.agree;
  }
  return sum * tube.evidence.support;
}

/// Tubes fitted to the level of their radius, the candidate that explains most first; each surfel belongs to one.
std::vector<ScanTube> chosen(std::vector<ScanTube> candidates, const ScanLevels& levels,
                             const ScanTubesConfig& config) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const ScanTube& a, const ScanTube& b) { return explained(a) > explained(b); });
  std::vector<ScanTube> tubes;
  std::vector<std::vector<char>> taken(levels.all.size());
  std::vector<std::size_t> tubes_in(levels.all.size(), 0);
  for (ScanTube& tube : candidates) {
    // Finer levels than it was found on may not hold all of it.
    const std::size_t fit_on =
        level_to_fit(tube.line.model.radius_m, kFitCellRadii, std::max(tube.level, levels.whole - 1), levels);
    const ScanLevel& level = levels.all[fit_on];
    std::vector<char>& flags = taken[fit_on];
    flags.resize(level.grid.surfels.size(), 0);
    const ScanSurface surface = surface_of(level, flags);
    for (std::size_t& next = tubes_in[fit_on]; next < tubes.size(); ++next) take(surface, tubes[next], flags);
    const bool fitted = std::exchange(tube.level, fit_on) == fit_on;
    if (!refine_scan_tube(surface, config, fitted, tube)) continue;
    if (!radius_in_range(tube.line.model.radius_m, config)) continue;
    tubes.push_back(std::move(tube));
  }
  return tubes;
}

bool ends_are_near(const ScanTube& a, const ScanTube& b) {
  constexpr double kNearRadii = 3.5;
  const double near_m = kNearRadii * std::max(a.line.model.radius_m, b.line.model.radius_m);
  for (const double t : {a.evidence.t_begin, a.evidence.t_end}) {
    for (const double other : {b.evidence.t_begin, b.evidence.t_end}) {
      if ((point_at(a.line.model.spline, t) - point_at(b.line.model.spline, other)).norm() < near_m) return true;
    }
  }
  return false;
}

/// Joins what are pieces of one tube, until none are left.
void join_pieces(std::vector<ScanTube>& tubes, const ScanLevels& levels, const ScanTubesConfig& config) {
  for (std::size_t i = 0; i < tubes.size(); ++i) {
    for (std::size_t k = i + 1; k < tubes.size();) {
      std::optional<ScanTube> joined;
      if (ends_are_near(tubes[i], tubes[k])) {
        const ScanLevel& level = levels.all[tubes[i].level];
        std::vector<char> taken(level.grid.surfels.size(), 0);
        const ScanSurface surface = surface_of(level, taken);
        for (std::size_t other = 0; other < tubes.size(); ++other) {
          if (other != i && other != k) take(surface, tubes[other], taken);
        }
        joined = join_scan_tubes(surface, config, tubes[i], tubes[k]);
      }
      if (!joined || !radius_in_range(joined->line.model.radius_m, config)) {
        ++k;
        continue;
      }
      joined->level = tubes[i].level;
      tubes[i] = std::move(*joined);
      tubes.erase(tubes.begin() + static_cast<std::ptrdiff_t>(k));
      k = i + 1;  // the longer tube may reach others now
    }
  }
}

}  // namespace

Expected<void> validate(const ScanTubesConfig& config) {
  const auto refuse = [](const char* field, double got, const char* takes) {
    return tl::make_unexpected(Error::usage(fmt::format("{}: {:g}, takes {}", field, got, takes)));
  };
  const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (!positive(config.grid_step_m)) return refuse("grid_step_m", config.grid_step_m, "metres, above 0");
  if (config.radius_m && !positive(*config.radius_m)) return refuse("radius_m", *config.radius_m, "metres, above 0");
  if (!positive(config.radius_min_m)) return refuse("radius_min_m", config.radius_min_m, "metres, above 0");
  if (!(config.radius_max_m > config.radius_min_m) || !std::isfinite(config.radius_max_m))
    return refuse("radius_max_m", config.radius_max_m, "metres, above radius_min_m");
  if (config.cell_m && !positive(*config.cell_m)) return refuse("cell_m", *config.cell_m, "metres, above 0");
  if (!positive(config.min_length_radii)) return refuse("min_length_radii", config.min_length_radii, "above 0");
  if (!(config.min_arc_rad >= 0.5 && config.min_arc_rad <= 6.0))
    return refuse("min_arc_rad", config.min_arc_rad, "0.5 to 6");
  return {};
}

TubeFrame find_scan_tubes(std::span<const ScanSurfel> surfels, const ScanTubesConfig& config) {
  Stopwatch all, watch;
  TubeFrame frame;
  frame.frame_id = "scan";
  const double low_m = config.radius_m ? (1.0 - kKnownBand) * *config.radius_m : config.radius_min_m;
  const double high_m = config.radius_m ? (1.0 + kKnownBand) * *config.radius_m : config.radius_max_m;
  std::vector<ScanTube> candidates;
  const std::vector<Octave> octaves = octaves_of(low_m, high_m, config.grid_step_m, config.cell_m);
  ScanLevels levels = levels_of(surfels, octaves, config.grid_step_m);
  watch.lap(frame.stages.normals_ms);
  std::vector<std::vector<char>> certain;
  for (const Octave& octave : octaves) {
    // Where all is taken, finer levels have nothing either.
    if (!certain.empty() && std::ranges::all_of(certain.back(), [](char taken) { return taken != 0; })) break;
    if (certain.size() < levels.whole || !is_fine_enough(levels.all[certain.size() - 1], octave, levels))
      go_to_level_of(octave, certain, levels);
    search_octave(octave, levels, config, certain, candidates, frame.stages);
  }
  certain = {};  // they have told what they are for
  double searched_ms = 0.0;
  watch.lap(searched_ms);  // search_octave has told
  std::vector<ScanTube> tubes = chosen(std::move(candidates), levels, config);
  join_pieces(tubes, levels, config);
  for (ScanTube& tube : tubes) {
    look_at_ends(surfels, tube.line, config.grid_step_m, tube.fit.scale_m, config.min_arc_rad, tube.evidence);
  }
  watch.lap(frame.stages.fit_ms);
  for (const ScanTube& tube : tubes) frame.tubes.push_back(result_of(tube, levels.all[tube.level].grid, config));
  std::stable_sort(frame.tubes.begin(), frame.tubes.end(),
                   [](const Tube& a, const Tube& b) { return a.length_m > b.length_m; });
  for (std::size_t i = 0; i < frame.tubes.size(); ++i) frame.tubes[i].id = static_cast<std::int64_t>(i) + 1;
  watch.lap(frame.stages.segment_ms);
  frame.status = frame.tubes.empty() ? TrackStatus::empty : TrackStatus::ok;
  all.lap(frame.latency_ms);
  return frame;
}

}  // namespace tubetrack
