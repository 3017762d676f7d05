#include "tubetrack/tracker/trace.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

TracePoint point_at(const AccumulationMap& map, const VoxelIndex& index, const Voxel& sum) {
  const double radius = sum.votes > 0 ? map.cell_m() * sum.steps / sum.votes : 0.0;
  return {index, map.center_of(index), sum.votes, radius};
}

/// The paper's extractPatch and getMaxCoords in one: the voxel with the most votes on the patch, ties to the lowest.
VoxelIndex best_on_patch(const AccumulationMap& map, const Eigen::Vector3d& center_m, const Eigen::Vector3d& normal,
                         const TraceOptions& options) {
  const Eigen::Vector3d e1 = normal.unitOrthogonal();
  const Eigen::Vector3d e2 = normal.cross(e1);
  const int half = std::max(1, static_cast<int>(std::lround(options.patch_half_m / map.cell_m())));
  VoxelIndex best = map.index_of(center_m);
  int best_votes = -1;
  for (int row = -half; row <= half; ++row) {
    for (int col = -half; col <= half; ++col) {
      const VoxelIndex index = map.index_of(center_m + map.cell_m() * (col * e1 + row * e2));
      const int votes = map.box_votes(index, options.box_half);
      if (votes > best_votes || (votes == best_votes && index < best)) {
        best_votes = votes;
        best = index;
      }
    }
  }
  return best;
}

/// Whether a line, whose points are at most `longest_m` from the one before, was here already. Behind a point that is
/// far away, as many can't be near as it takes to come back: so few are looked at, however long the line is.
bool comes_back(const RecycledVector<TracePoint>& line, const Eigen::Vector3d& position_m, double step_m,
                double longest_m) {
  const std::size_t end = line.size() - std::min<std::size_t>(line.size(), 3);
  for (std::size_t i = 0; i < end; ++i) {
    const double beyond_m = (line[i].position_m - position_m).norm() - 0.5 * step_m;
    if (beyond_m < 0.0) return true;
    i += static_cast<std::size_t>(beyond_m / longest_m);
  }
  return false;
}

}  // namespace

bool is_inside_tube(int votes, int start_votes, const Eigen::Vector3d& step, const Eigen::Vector3d& direction) {
  return 4 * votes >= start_votes && step.dot(direction) >= 0.5 * step.norm() * direction.norm();
}

RecycledVector<TracePoint> trace_one_way(const AccumulationMap& map, const VoxelIndex& start, bool in_front,
                                         const TraceOptions& options) {
  RecycledVector<TracePoint> line;
  Voxel sum = map.box(start, options.box_half);
  TracePoint current = point_at(map, start, sum);
  const int start_votes = current.votes;
  double longest_m = options.step_m;
  Eigen::Vector3d last = axis_of(sum).direction * (in_front ? 1.0 : -1.0);
  Eigen::Vector3d previous_m = current.position_m - last * options.step_m;
  for (int i = 0; i < options.max_steps; ++i) {
    Eigen::Vector3d direction = axis_of(sum).direction;
    if (last.dot(direction) < 0.0) direction = -direction;
    if (!is_inside_tube(current.votes, start_votes, current.position_m - previous_m, direction)) break;
    if (comes_back(line, current.position_m, options.step_m, longest_m)) break;
    if (!line.empty()) longest_m = std::max(longest_m, (current.position_m - line.back().position_m).norm());
    line.push_back(current);
    const Eigen::Vector3d center_m = current.position_m + direction * options.step_m;
    previous_m = current.position_m;
    last = direction;
    const VoxelIndex next = best_on_patch(map, center_m, direction, options);
    sum = map.box(next, options.box_half);
    current = point_at(map, next, sum);
  }
  return line;
}

void trace_on(const AccumulationMap& map, double radius_m, int least_votes, const TraceOptions& options,
              RecycledVector<Eigen::Vector3d>& line_m) {
  constexpr int kMostUnseen = 3;
  int unseen = 0;
  for (int i = 0; i < options.max_steps && unseen <= kMostUnseen; ++i) {
    const Eigen::Vector3d last_m = line_m.back();
    const Eigen::Vector3d direction = (last_m - line_m[line_m.size() - 3]).normalized();
    const Eigen::Vector3d center_m = last_m + (1 + unseen) * options.step_m * direction;
    const VoxelIndex next = best_on_patch(map, center_m, direction, options);
    const TracePoint point = point_at(map, next, map.box(next, options.box_half));
    const Eigen::Vector3d step = point.position_m - last_m;
    const bool inside = point.votes >= least_votes && std::abs(point.radius_m - radius_m) < kOneRadius * radius_m &&
                        step.dot(direction) > kSmoothTurn * step.norm();
    if (!inside) {
      ++unseen;
      continue;
    }
    const auto is_here = [&](const Eigen::Vector3d& m) { return (m - point.position_m).norm() < 0.5 * options.step_m; };
    if (std::any_of(line_m.begin(), line_m.end() - 1, is_here)) return;  // a ring
    for (int gap = 1; gap <= unseen; ++gap) line_m.push_back(last_m + gap * step / (1 + unseen));
    line_m.push_back(point.position_m);
    unseen = 0;
  }
}

RecycledVector<TracePoint> trace_both_ways(const AccumulationMap& map, const VoxelIndex& start,
                                           const TraceOptions& options) {
  RecycledVector<TracePoint> line = trace_one_way(map, start, false, options);
  std::reverse(line.begin(), line.end());
  if (line.empty()) line.push_back(point_at(map, start, map.box(start, options.box_half)));
  const RecycledVector<TracePoint> front = trace_one_way(map, start, true, options);
  if (front.size() > 1) line.insert(line.end(), front.begin() + 1, front.end());
  return line;
}

}  // namespace tubetrack
