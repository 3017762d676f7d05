#include "tubetrack/tracker/find_tubes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "hide.hpp"
#include "stopwatch.hpp"
#include "tubetrack/tracker/join.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/seed.hpp"
#include "tubetrack/tracker/trace.hpp"

namespace tubetrack {

namespace {

constexpr int kMinVotes = 12;
constexpr double kLeastSpread = 0.01;         // what is flat votes alike
constexpr double kLeastVotesPerPixel = 0.25;  // a third of what tubes have (find_tubes_test)
constexpr double kShares = 0.003;             // of a tube's pixels
constexpr int kFirstRest = 8;                 // frames
constexpr int kLongestRest = 32;              // a second

/// The traced points around the peak as long as they run smoothly and at one radius.
RecycledVector<Eigen::Vector3d> smooth_part(const RecycledVector<TracePoint>& trace, const VoxelIndex& peak,
                                            double radius_m) {
  const auto start = std::find_if(trace.begin(), trace.end(), [&](const TracePoint& p) { return p.voxel == peak; });
  const auto calm = [&](const TracePoint& before, const TracePoint& at, const TracePoint& after) {
    const Eigen::Vector3d first = at.position_m - before.position_m;
    const Eigen::Vector3d second = after.position_m - at.position_m;
    return first.dot(second) > kSmoothTurn * first.norm() * second.norm() &&
           std::abs(after.radius_m - radius_m) < kOneRadius * radius_m;
  };
  RecycledVector<Eigen::Vector3d> line;
  if (start == trace.end() || start == trace.begin() || start + 1 == trace.end()) return line;
  auto first = start - 1;
  auto last = start + 1;
  while (first != trace.begin() && calm(first[1], first[0], first[-1])) --first;
  while (last + 1 != trace.end() && calm(last[-1], last[0], last[1])) ++last;
  for (auto at = first; at <= last; ++at) line.push_back(at->position_m);
  return line;
}

/// Carries a line on both ways by what a few votes tell of a tube of this radius: each span that it has from the start
/// is a round less to grow.
void trace_on_both_ways(const AccumulationMap& votes, double radius_m, RecycledVector<Eigen::Vector3d>& line_m) {
  for (int way = 0; way < 2; ++way) {
    trace_on(votes, radius_m, kMinVotes, {radius_m, 0.5 * radius_m}, line_m);
    std::reverse(line_m.begin(), line_m.end());
  }
}

/// Carries on the traced line of a fitted seed, or where there is none the seed itself, if that makes it a long one: a
/// mug's votes lead beyond it.
void trace_on_from(const AccumulationMap& votes, TubeModel& fitted, Seed& seed) {
  if (seed.line_m.size() > 3) {
    trace_on_both_ways(votes, fitted.radius_m, seed.line_m);
    return;
  }
  RecycledVector<Eigen::Vector3d> line_m;
  for (const double part : {0.0, 0.5, 1.0}) line_m.push_back(point_at(fitted.spline, part * fitted.spline.spans()));
  trace_on_both_ways(votes, fitted.radius_m, line_m);
  constexpr std::size_t kLong = 16;
  if (line_m.size() > kLong) fitted.spline = spline_along(line_m, kKnotSpacingRadii * fitted.radius_m);
}

/// The radius votes come from, over the trace: the median of its points.
double radius_of(RecycledVector<TracePoint> trace) {
  const auto middle = trace.begin() + static_cast<std::ptrdiff_t>(trace.size() / 2);
  std::nth_element(trace.begin(), middle, trace.end(),
                   [](const TracePoint& a, const TracePoint& b) { return a.radius_m < b.radius_m; });
  return middle->radius_m;
}

bool lies_at(const FailedPlace& place, const Eigen::Vector3d& center_m, double cell_m) {
  const double near_m = std::max(2.0 * cell_m, 0.3 * place.radius_m);
  return (place.position_m - center_m).squaredNorm() < near_m * near_m;
}

bool is_at_rest(const RecycledVector<FailedPlace>& failed, const Eigen::Vector3d& center_m, int votes, double cell_m) {
  return std::any_of(failed.begin(), failed.end(), [&](const FailedPlace& place) {
    return place.frames < place.rest_frames && 2 * votes < 3 * place.votes && lies_at(place, center_m, cell_m);
  });
}

/// The whole trace of a seed that failed.
void put_to_rest(RecycledVector<FailedPlace>& failed, const RecycledVector<TracePoint>& trace, int votes,
                 double cell_m) {
  int rest = kFirstRest;
  const Eigen::Vector3d& center_m = trace[trace.size() / 2].position_m;
  for (const FailedPlace& place : failed) {
    if (lies_at(place, center_m, cell_m)) rest = std::max(rest, std::min(2 * place.rest_frames, kLongestRest));
  }
  for (const TracePoint& point : trace)
    failed.push_back({point.position_m, point.radius_m, std::max(point.votes, votes), rest, 0});
}

/// Drops the tubes of which this one is a longer fit. False if it is itself one that is known.
bool take_place(RecycledVector<FoundTube>& tubes, const FoundTube& found) {
  const auto is_part = [](const FoundTube& part, const FoundTube& whole) {
    return same_tube(part.model, part.extent, whole.model, whole.extent);
  };
  const bool known = std::any_of(tubes.begin(), tubes.end(), [&](const FoundTube& tube) {
    return is_part(found, tube) && found.evidence.length_m < tube.evidence.length_m + found.model.radius_m;
  });
  if (known) return false;
  std::erase_if(tubes, [&](const FoundTube& tube) { return is_part(tube, found); });
  return true;
}

/// Fits every tube again that others are seen in front of, without the pixels that are theirs: where two touch, the
/// flank of one runs on into the other's. A few pixels do not pull: each is off by a tenth of the radius at most.
void part_neighbors(RecycledVector<FoundTube>& tubes, HeightMap& map, const TrackerConfig& config) {
  HiddenCells hidden;
  for (FoundTube& tube : tubes) {
    const SeenTube mine = seen(tube);
    for (const FoundTube& other : tubes) {
      if (&other != &tube) hide_from(&mine, seen(other), map, hidden);
    }
    hide_beside_gaps(mine, map, hidden);
    const auto& cells = tube.pixels.cell;
    const auto shared = std::count_if(cells.begin(), cells.begin() + static_cast<std::ptrdiff_t>(tube.pixels.size()),
                                      [&](std::uint32_t cell) { return map.depth_m[cell] < 0.0F; });
    if (static_cast<double>(shared) > kShares * static_cast<double>(tube.pixels.size())) fit_again(map, config, tube);
    show_again(map, hidden);
  }
}

/// Tries again the seeds that did not show a tube, without the pixels of the tubes found since.
void try_again(const RecycledVector<Seed>& refused, RecycledVector<FoundTube>& tubes, HeightMap& map,
               const TrackerConfig& config) {
  HiddenCells hidden;
  for (const Seed& seed : refused) {
    for (const FoundTube& other : tubes) hide_from(nullptr, seen(other), map, hidden);
    const auto start = fit_seed(map, config, seed);
    auto found = start ? grow_tube(map, config, *start, seed.line_m) : std::nullopt;
    if (found && !why_no_tube(found->evidence, found->model.radius_m, config)) {
      go_on_behind(map, config, *found);
      if (take_place(tubes, *found)) tubes.push_back(std::move(*found));
    }
    show_again(map, hidden);
  }
}

/// Withdraws the votes of every surfel on the tube.
void withdraw_explained(AccumulationMap& votes, std::span<const Surfel> surfels, std::span<const CastVote> cast,
                        const FoundTube& tube, RecycledVector<bool>& withdrawn) {
  const PredictedPixels& pixels = tube.pixels;  // in cell order, as the surfels are
  std::size_t at = 0;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    while (at < pixels.size() && pixels.cell[at] < surfels[i].cell) ++at;
    if (at == pixels.size()) break;
    if (pixels.cell[at] != surfels[i].cell || withdrawn[i]) continue;
    if (std::abs(surfels[i].position_m.z() - pixels.depth_m[at]) >
        0.5 * tube.model.radius_m + 4.0F * surfels[i].sigma_m)
      continue;
    withdrawn[i] = true;
    votes.withdraw(cast[i].record);
  }
}

}  // namespace

double matching_cell_m(std::span<const Surfel> surfels, double focal_px) {
  if (surfels.empty()) return 0.0;
  RecycledVector<float> depths;
  depths.reserve(surfels.size());
  for (const Surfel& surfel : surfels) depths.push_back(surfel.position_m.z());
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  const double two_pixels_m = 2.0 * *middle / focal_px;
  return 0.001 * std::pow(2.0, 0.5 * std::round(2.0 * std::log2(two_pixels_m / 0.001)));
}

bool is_sparse(const Voxel& box, double radius_m, double cell_m, double px_per_m) {
  constexpr double kBoxCells = 3.0;
  const double pixels = kBoxCells * cell_m * px_per_m * 2.0 * radius_m * px_per_m;
  return box.votes < kLeastVotesPerPixel * pixels;
}

RecycledVector<FoundTube> find_tubes(AccumulationMap& votes, std::span<const Surfel> surfels,
                                     std::vector<CastVote>& cast, std::span<const FollowedTube> known, HeightMap& map,
                                     const TrackerConfig& config, int max_failures, Deadline& deadline,
                                     RecycledVector<FailedPlace>& failed, StageTimes& times) {
  Stopwatch watch;
  RecycledVector<FoundTube> tubes;
  RecycledVector<bool> withdrawn(surfels.size(), false);
  for (FailedPlace& place : failed) ++place.frames;
  std::erase_if(failed, [](const FailedPlace& place) { return place.frames >= 2 * place.rest_frames; });
  int failures = 0;
  RecycledVector<Seed> refused;
  HiddenCells hidden;
  bool known_are_hidden = false;  // most frames try no seed at all
  const std::vector<VoxelIndex>& peaks = votes.peaks(kMinVotes, 1);
  watch.lap(times.trace_ms);
  for (std::size_t i = 0; i < peaks.size(); ++i) {
    if (failures >= max_failures || deadline.passed()) break;
    const VoxelIndex& peak = peaks[i];
    // Until a tube's votes are withdrawn, what was remembered of a peak holds.
    const bool as_it_was = tubes.empty();
    if (as_it_was && votes.peak_spread(i) < kLeastSpread) continue;
    const int votes_there = as_it_was ? votes.peak_votes(i) : votes.box_votes(peak, 1);
    if (votes_there < kMinVotes) continue;
    const Eigen::Vector3d center = votes.center_of(peak);
    if (is_at_rest(failed, center, votes_there, votes.cell_m())) continue;
    const Voxel sum = votes.box(peak, 1);
    if (!as_it_was && axis_of(sum).spread < kLeastSpread) continue;
    const double radius_at_peak_m = votes.cell_m() * sum.steps / sum.votes;
    const double px_per_m = map.intrinsics.fx_px / std::max(center.z(), 0.05);
    if (is_sparse(sum, radius_at_peak_m, votes.cell_m(), px_per_m)) continue;
    TraceOptions options;
    options.step_m = config.radius_m.value_or(radius_at_peak_m);
    options.patch_half_m = 0.5 * options.step_m;
    const RecycledVector<TracePoint> trace = trace_both_ways(votes, peak, options);
    const double radius_m = config.radius_m.value_or(radius_of(trace));
    Seed seed{center, axis_of(sum).direction, radius_m, smooth_part(trace, peak, radius_m)};
    watch.lap(times.trace_ms);
    if (!std::exchange(known_are_hidden, true)) hide_others(known, nullptr, nullptr, map, hidden);
    auto start = fit_seed(map, config, seed);
    if (start) trace_on_from(votes, start->model, seed);
    auto found = start ? grow_tube(map, config, *start, seed.line_m) : std::nullopt;
    if (found && why_no_tube(found->evidence, found->model.radius_m, config)) {
      refused.push_back(seed);
      found.reset();
    }
    if (found) go_on_behind(map, config, *found);
    if (!found || !take_place(tubes, *found)) {
      ++failures;
      put_to_rest(failed, trace, sum.votes, votes.cell_m());
      watch.lap(times.fit_ms);
      continue;
    }
    withdraw_explained(votes, surfels, cast, *found, withdrawn);
    tubes.push_back(std::move(*found));
    watch.lap(times.fit_ms);
  }
  if (tubes.size() > 1 && !deadline.passed()) part_neighbors(tubes, map, config);
  const std::size_t found_at_once = tubes.size();
  if (!refused.empty() && !tubes.empty() && !deadline.passed()) try_again(refused, tubes, map, config);
  if (tubes.size() != found_at_once) part_neighbors(tubes, map, config);
  watch.lap(times.fit_ms);
  show_again(map, hidden);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cast.size(); ++i) {
    if (!withdrawn[i]) cast[kept++] = cast[i];
  }
  cast.resize(kept);
  return tubes;
}

}  // namespace tubetrack
