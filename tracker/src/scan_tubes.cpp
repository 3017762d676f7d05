#include "tubetrack/tracker/scan_tubes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scan_grow.hpp"
#include "scan_result.hpp"
#include "scan_votes.hpp"
#include "stopwatch.hpp"

namespace tubetrack {

namespace {

constexpr int kMinVotes = 6 * kVotesPerCell;
constexpr int kMaxFailures = 24;       // of the seeds of one octave
constexpr double kKnownBand = 0.15;    // votes go so far to either side of a known radius
constexpr double kBelongsRadii = 0.3;  // what is so near to a tube's surface is no other's

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

bool radius_in_range(double radius_m, const ScanTubesConfig& config) {
  return config.radius_m || (radius_m >= config.radius_min_m && radius_m <= config.radius_max_m);
}

/// Beyond doubt: nearly all that is near agrees, and closely. Its surfels are not looked at again for other radii.
bool is_certain(const ScanEvidence& evidence) {
  constexpr double kAgree = 0.9, kScatterRadii = 0.02, kScatterSpacings = 0.4;
  return evidence.support > kAgree &&
         evidence.scale_radii < std::max(kScatterRadii, kScatterSpacings * evidence.spacing_radii);
}

/// What looks like a tube of an octave's radii: from the best peak on, each of surfels that no earlier one has.
void search_octave(const Octave& octave, const ScanTubesConfig& config, std::vector<ScanTube>& candidates,
                   StageTimes& times) {
  Stopwatch watch;
  AccumulationMap votes(octave.cell_m);
  const double spacing_m = std::max(octave.cell_m, config.grid_step_m);
  std::vector<char> taken(octave.surfels.size(), 0);
  for (const ScanTube& tube : candidates) {
    if (is_certain(tube.evidence)) take(octave.surfels, tube, spacing_m, taken);
  }
  std::vector<VoteRecord> records;
  records.reserve(octave.surfels.size());
  for (std::size_t i = 0; i < octave.surfels.size(); ++i) {
    records.push_back(weighted_record(octave.surfels[i], octave, config.grid_step_m));
    if (taken[i] == 0) votes.add(records.back());
  }
  watch.lap(times.accumulate_ms);
  const double near_m = std::max(2.0 * octave.cell_m, 0.3 * octave.radius_min_m);
  std::vector<Eigen::Vector3d> failed_m;
  int failures = 0;
  for (const VoxelIndex& peak : votes.peaks(kMinVotes, 1)) {
    if (failures >= kMaxFailures) break;
    if (votes.box_votes(peak, 1) < kMinVotes || lies_near(failed_m, votes.center_of(peak), near_m)) continue;
    const auto seed = seed_at(votes, peak, octave);
    watch.lap(times.trace_ms);
    if (!seed) continue;
    auto tube = grow_scan_tube({octave.surfels, taken, spacing_m}, *seed, config);
    if (!tube || !radius_in_range(tube->line.model.radius_m, config)) {
      ++failures;
      failed_m.insert(failed_m.end(), seed->line_m.begin(), seed->line_m.end());
      failed_m.push_back(votes.center_of(peak));
    } else {
      for (const std::uint32_t index : take(octave.surfels, *tube, spacing_m, taken)) votes.withdraw(records[index]);
      candidates.push_back(std::move(*tube));
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

/// Tubes fitted to all surfels, the candidate that explains most first; each surfel belongs to one.
std::vector<ScanTube> chosen(std::vector<ScanTube> candidates, std::span<const Surfel> surfels,
                             const ScanTubesConfig& config) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const ScanTube& a, const ScanTube& b) { return explained(a) > explained(b); });
  std::vector<ScanTube> tubes;
  std::vector<char> taken(surfels.size(), 0);
  for (ScanTube& tube : candidates) {
    if (!refine_scan_tube({surfels, taken, config.grid_step_m}, config, tube)) continue;
    if (!radius_in_range(tube.line.model.radius_m, config)) continue;
    take(surfels, tube, config.grid_step_m, taken);
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
void join_pieces(std::vector<ScanTube>& tubes, std::span<const Surfel> surfels, const ScanTubesConfig& config) {
  for (std::size_t i = 0; i < tubes.size(); ++i) {
    for (std::size_t k = i + 1; k < tubes.size();) {
      std::optional<ScanTube> joined;
      if (ends_are_near(tubes[i], tubes[k])) {
        std::vector<char> taken(surfels.size(), 0);
        for (std::size_t other = 0; other < tubes.size(); ++other) {
          if (other != i && other != k) take(surfels, tubes[other], config.grid_step_m, taken);
        }
        joined = join_scan_tubes({surfels, taken, config.grid_step_m}, config, tubes[i], tubes[k]);
      }
      if (!joined || !radius_in_range(joined->line.model.radius_m, config)) {
        ++k;
        continue;
      }
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

TubeFrame find_scan_tubes(std::span<const Surfel> surfels, const ScanTubesConfig& config) {
  Stopwatch all, watch;
  TubeFrame frame;
  frame.frame_id = "scan";
  const double low_m = config.radius_m ? (1.0 - kKnownBand) * *config.radius_m : config.radius_min_m;
  const double high_m = config.radius_m ? (1.0 + kKnownBand) * *config.radius_m : config.radius_max_m;
  std::vector<ScanTube> candidates;
  std::vector<Octave> octaves = octaves_of(surfels, low_m, high_m, config.grid_step_m, config.cell_m);
  watch.lap(frame.stages.normals_ms);
  for (const Octave& octave : octaves) search_octave(octave, config, candidates, frame.stages);
  double searched_ms = 0.0;
  watch.lap(searched_ms);  // search_octave has told
  std::vector<ScanTube> tubes = chosen(std::move(candidates), surfels, config);
  join_pieces(tubes, surfels, config);
  watch.lap(frame.stages.fit_ms);
  for (const ScanTube& tube : tubes) frame.tubes.push_back(result_of(tube, surfels, config));
  std::stable_sort(frame.tubes.begin(), frame.tubes.end(),
                   [](const Tube& a, const Tube& b) { return a.length_m > b.length_m; });
  for (std::size_t i = 0; i < frame.tubes.size(); ++i) frame.tubes[i].id = static_cast<std::int64_t>(i) + 1;
  watch.lap(frame.stages.segment_ms);
  frame.status = frame.tubes.empty() ? TrackStatus::empty : TrackStatus::ok;
  all.lap(frame.latency_ms);
  return frame;
}

}  // namespace tubetrack
