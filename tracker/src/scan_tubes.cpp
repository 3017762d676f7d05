#include "tubetrack/tracker/scan_tubes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scan_grow.hpp"
#include "scan_votes.hpp"
#include "stopwatch.hpp"
#include "tube_result.hpp"

namespace tubetrack {

namespace {

constexpr int kMinVotes = 6 * kVotesPerCell;
constexpr int kMaxFailures = 40;      // of the seeds of one octave
constexpr double kKnownBand = 0.15;   // votes go so far to either side of a known radius
constexpr double kBelongsRadii = 0.3; // what is so near to a tube's surface is no other's

/// An octave in use: which of its surfels are taken by a tube.
struct Level {
  Octave octave;
  std::vector<char> taken;
};

struct Search {
  std::span<const Surfel> surfels;
  std::vector<char> taken;
  const ScanTubesConfig& config;
  std::vector<Level> levels;
  std::vector<ScanTube> tubes;
};

/// Sets the flags of the surfels of a tube, and returns which were set.
std::vector<std::uint32_t> take(std::span<const Surfel> surfels, const ScanTube& tube, double spacing_m,
                                std::vector<char>& taken) {
  std::vector<std::uint32_t> set;
  const double radius_m = tube.line.model.radius_m;
  const double belongs_m = std::max(kBelongsRadii * radius_m, spacing_m);
  for (const SurfacePoint& point : points_near(surfels, taken, tube.line)) {
    if (std::abs(point.distance_m - radius_m) > belongs_m || taken[point.surfel] != 0) continue;
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

void search_level(Search& search, std::size_t at, StageTimes& times) {
  Stopwatch watch;
  const ScanTubesConfig& config = search.config;
  Level& level = search.levels[at];
  const double cell_m = level.octave.cell_m;
  AccumulationMap votes(cell_m);
  std::vector<VoteRecord> records;
  records.reserve(level.octave.surfels.size());
  for (std::size_t i = 0; i < level.octave.surfels.size(); ++i) {
    records.push_back(weighted_record(level.octave.surfels[i], level.octave, config.grid_step_m));
    if (level.taken[i] == 0) votes.add(records.back());
  }
  watch.lap(times.accumulate_ms);
  const double spacing_m = std::max(cell_m, config.grid_step_m);
  std::vector<Eigen::Vector3d> failed_m;
  int failures = 0;
  for (const VoxelIndex& peak : votes.peaks(kMinVotes, 1)) {
    if (failures >= kMaxFailures) break;
    if (votes.box_votes(peak, 1) < kMinVotes) continue;
    if (lies_near(failed_m, votes.center_of(peak), std::max(2.0 * cell_m, 0.3 * level.octave.radius_min_m))) continue;
    const auto seed = seed_at(votes, peak, level.octave);
    watch.lap(times.trace_ms);
    if (!seed) continue;
    auto tube = grow_scan_tube({level.octave.surfels, level.taken, spacing_m}, *seed, config);
    const bool found = tube && refine_scan_tube({search.surfels, search.taken, config.grid_step_m}, config, *tube);
    const double radius_m = tube ? tube->line.model.radius_m : 0.0;
    if (!found || (!config.radius_m && (radius_m < config.radius_min_m || radius_m > config.radius_max_m))) {
      ++failures;
      failed_m.insert(failed_m.end(), seed->line_m.begin(), seed->line_m.end());
      failed_m.push_back(votes.center_of(peak));
      watch.lap(times.fit_ms);
      continue;
    }
    take(search.surfels, *tube, config.grid_step_m, search.taken);
    for (std::size_t other = 0; other < search.levels.size(); ++other) {
      if (other < at) continue;  // larger radii: done with
      const auto set = take(search.levels[other].octave.surfels, *tube, spacing_m, search.levels[other].taken);
      if (other != at) continue;
      for (const std::uint32_t index : set) votes.withdraw(records[index]);
    }
    search.tubes.push_back(std::move(*tube));
    watch.lap(times.fit_ms);
  }
}

const FitWindow& window_at(const ScanFit& fit, double t) {
  const auto after = std::find_if(fit.windows.begin(), fit.windows.end(),
                                  [t](const FitWindow& window) { return t <= window.t_end; });
  return after == fit.windows.end() ? fit.windows.back() : *after;
}

Tube result_of(const ScanTube& found) {
  Tube tube;
  const Spline& spline = found.line.model.spline;
  const ScanEvidence& evidence = found.evidence;
  tube.radius_m = found.line.model.radius_m;
  tube.radius_sigma_m = found.fit.radius_sigma_m;
  tube.confidence = std::min(1.0, evidence.support);
  tube.closed = found.line.closed();
  constexpr double kNodeRadii = 0.5;
  const int spans = std::max(2, static_cast<int>(std::ceil(evidence.length_m / (kNodeRadii * tube.radius_m))));
  std::size_t station = 0;
  for (int i = 0; i <= spans; ++i) {
    const double t = evidence.t_begin + (evidence.t_end - evidence.t_begin) * i / spans;
    tube.centerline_m.push_back(point_at(spline, t));
    while (station + 1 < evidence.stations.size() &&
           std::abs(evidence.stations[station + 1].t - t) <= std::abs(evidence.stations[station].t - t))
      ++station;
    tube.node_visible.push_back(evidence.stations[station].seen);
    const FitWindow& window = window_at(found.fit, t);
    add_uncertainty(window.spline, window.covariance, t - static_cast<double>(window.first), tube);
  }
  if (tube.closed) tube.centerline_m.back() = tube.centerline_m.front();
  for (std::size_t i = 1; i < tube.centerline_m.size(); ++i)
    tube.length_m += (tube.centerline_m[i] - tube.centerline_m[i - 1]).norm();
  return tube;
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

TubeFrame find_scan_tubes(std::span<const Surfel> surfels, const ScanTubesConfig& config) {
  Stopwatch all, watch;
  TubeFrame frame;
  frame.frame_id = "scan";
  const double low_m = config.radius_m ? (1.0 - kKnownBand) * *config.radius_m : config.radius_min_m;
  const double high_m = config.radius_m ? (1.0 + kKnownBand) * *config.radius_m : config.radius_max_m;
  Search search{surfels, std::vector<char>(surfels.size(), 0), config, {}, {}};
  for (Octave& octave : octaves_of(surfels, low_m, high_m, config.grid_step_m, config.cell_m)) {
    std::vector<char> taken(octave.surfels.size(), 0);
    search.levels.push_back({std::move(octave), std::move(taken)});
  }
  watch.lap(frame.stages.normals_ms);
  for (std::size_t at = 0; at < search.levels.size(); ++at) {
    search_level(search, at, frame.stages);
    search.levels[at].octave.surfels = {};  // done with
    search.levels[at].taken = {};
  }
  watch.lap(frame.stages.update_ms);
  frame.stages.update_ms = 0.0;  // what search_level took, which has told itself
  for (const ScanTube& tube : search.tubes) frame.tubes.push_back(result_of(tube));
  std::stable_sort(frame.tubes.begin(), frame.tubes.end(),
                   [](const Tube& a, const Tube& b) { return a.length_m > b.length_m; });
  for (std::size_t i = 0; i < frame.tubes.size(); ++i) {
    frame.tubes[i].id = static_cast<std::int64_t>(i) + 1;
    add_parts(frame.tubes[i]);
  }
  watch.lap(frame.stages.segment_ms);
  frame.status = frame.tubes.empty() ? TrackStatus::empty : TrackStatus::ok;
  all.lap(frame.latency_ms);
  return frame;
}

}  // namespace tubetrack
