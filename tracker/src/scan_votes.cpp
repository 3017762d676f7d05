#include "scan_votes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "tubetrack/tracker/trace.hpp"

namespace tubetrack {

namespace {

constexpr double kCellRadii = 0.25;        // a map's cell, of the smallest radius it is for
constexpr double kLargestCellRadii = 0.5;  // where the scan is coarser than that
constexpr int kMaxVotes = 64;

/// The trace from the start up to the point before it is back there; empty where it never is.
RecycledVector<TracePoint> once_around(const RecycledVector<TracePoint>& trace, double step_m) {
  constexpr std::size_t kFewestPoints = 6;
  for (std::size_t i = kFewestPoints; i < trace.size(); ++i) {
    const Eigen::Vector3d to_start = trace.front().position_m - trace[i].position_m;
    const Eigen::Vector3d onward = trace[i].position_m - trace[i - 1].position_m;
    const Eigen::Vector3d first = trace[1].position_m - trace[0].position_m;
    if (to_start.norm() > 1.6 * step_m || onward.dot(first) <= 0.0) continue;
    const bool too_near = to_start.norm() < 0.5 * step_m || to_start.dot(first) < 0.0;
    return {trace.begin(), trace.begin() + static_cast<std::ptrdiff_t>(too_near ? i : i + 1)};
  }
  return {};
}

bool is_flat(const SurfelGrid& grid, const SurfelBucket& bucket) {
  constexpr double kMostSpread = 0.0002;  // 1 less the length of the mean normal
  constexpr std::uint32_t kFewest = 6;    // along a tube a single row of four is flat
  const std::uint32_t count = bucket.end - bucket.begin;
  if (count < kFewest) return false;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (std::uint32_t i = bucket.begin; i < bucket.end; ++i) normal += grid.surfels[i].inward_normal.cast<double>();
  return normal.norm() >= (1.0 - kMostSpread) * count;
}

double median_radius_m(RecycledVector<TracePoint> trace) {
  const auto middle = trace.begin() + static_cast<std::ptrdiff_t>(trace.size() / 2);
  std::nth_element(trace.begin(), middle, trace.end(),
                   [](const TracePoint& a, const TracePoint& b) { return a.radius_m < b.radius_m; });
  return middle->radius_m;
}

}  // namespace

std::vector<Octave> octaves_of(double radius_min_m, double radius_max_m, double grid_step_m,
                               std::optional<double> cell_m) {
  const int count = std::max(1, static_cast<int>(std::ceil(std::log2(radius_max_m / radius_min_m) - 1e-9)));
  std::vector<Octave> octaves;
  for (int i = count; i-- > 0;) {
    const double low = radius_min_m * std::pow(radius_max_m / radius_min_m, static_cast<double>(i) / count);
    const double high = radius_min_m * std::pow(radius_max_m / radius_min_m, static_cast<double>(i + 1) / count);
    // A little more on either side: a peak is as wide as a cell or two.
    const double coarse_m = std::min(grid_step_m, kLargestCellRadii * low);
    octaves.push_back({0.92 * low, 1.08 * high, cell_m.value_or(std::max(kCellRadii * low, coarse_m))});
  }
  return octaves;
}

VoteRecord weighted_record(const CellSurfel& surfel, const Octave& octave, double grid_step_m) {
  Surfel voter{surfel.position_m, surfel.inward_normal};
  voter.radius_min_m = static_cast<float>(octave.radius_min_m);
  voter.radius_max_m = static_cast<float>(octave.radius_max_m);
  VoteRecord record = vote_record(voter, octave.cell_m);
  const double steps_per_cell = grid_step_m / octave.cell_m;
  const double cells = static_cast<double>(surfel.weight) * steps_per_cell * steps_per_cell;
  record.weight = static_cast<std::int32_t>(std::lround(std::clamp(kVotesPerCell * cells, 1.0, 1.0 * kMaxVotes)));
  return record;
}

std::vector<char> flat_surfels(const SurfelGrid& grid) {
  std::vector<char> flat(grid.surfels.size(), 0);
  for (const SurfelBucket& bucket : grid.buckets) {
    if (is_flat(grid, bucket)) std::fill(flat.begin() + bucket.begin, flat.begin() + bucket.end, 1);
  }
  return flat;
}

std::vector<char> flat_around(const SurfelGrid& grid) {
  std::vector<char> alone(grid.buckets.size(), 1);
  std::vector<std::uint32_t> around;
  const double bucket_m = grid.bucket_radius_m() * 2.0 / std::numbers::sqrt3;
  for (const SurfelBucket& bucket : grid.buckets) {
    if (is_flat(grid, bucket)) continue;
    const Eigen::Vector3d reach_m = Eigen::Vector3d::Constant(bucket_m);
    grid.buckets_in({bucket.center_m - reach_m, bucket.center_m + reach_m}, around);
    for (const std::uint32_t number : around) alone[number] = 0;
  }
  std::vector<char> flat(grid.surfels.size(), 0);
  for (std::size_t i = 0; i < alone.size(); ++i)
    std::fill(flat.begin() + grid.buckets[i].begin, flat.begin() + grid.buckets[i].end, alone[i]);
  return flat;
}

std::optional<ScanSeed> seed_at(const AccumulationMap& votes, const VoxelIndex& peak, const Octave& octave,
                                int max_steps) {
  // Directions spread over an arc of 80° have 0.147 of their moments across its middle; those of a sphere's votes, or a
  // corner's, are spread in all three directions.
  constexpr double kLeastSpread = 0.12, kMostPlanar = 0.5;
  const Voxel sum = votes.box(peak, 1);
  const VoxelAxis axis = axis_of(sum);
  if (axis.spread < kLeastSpread || axis.planar > kMostPlanar) return std::nullopt;
  TraceOptions options;
  options.step_m = std::clamp(votes.cell_m() * sum.steps / sum.votes, octave.radius_min_m, octave.radius_max_m);
  options.patch_half_m = 0.5 * options.step_m;
  options.max_steps = max_steps;
  const RecycledVector<TracePoint> front = trace_one_way(votes, peak, true, options);
  RecycledVector<TracePoint> line = once_around(front, options.step_m);
  ScanSeed seed;
  seed.closed = !line.empty();
  if (!seed.closed) {
    line = trace_one_way(votes, peak, false, options);
    std::reverse(line.begin(), line.end());
    if (front.size() > 1) line.insert(line.end(), front.begin() + (line.empty() ? 0 : 1), front.end());
  }
  const Eigen::Vector3d center_m = votes.center_of(peak);
  for (const TracePoint& point : line) seed.line_m.push_back(point.position_m);
  seed.radius_m = line.empty() ? options.step_m : median_radius_m(line);
  if (line.size() < 2) {
    seed.line_m = {center_m - 0.75 * options.step_m * axis.direction,
                   center_m + 0.75 * options.step_m * axis.direction};
  }
  return seed;
}

}  // namespace tubetrack
