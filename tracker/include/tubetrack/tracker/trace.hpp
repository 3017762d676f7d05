#pragma once

#include "tubetrack/tracker/accumulation_map.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// Settings of algorithm 2 of the paper.
struct TraceOptions {
  double step_m = 0.0;        ///< trackStep: distance between points
  double patch_half_m = 0.0;  ///< half the side of the patch searched at each step (the paper: accRadius)
  int box_half = 1;           ///< votes are read as sums over (2·box_half + 1)³ voxels; 0: the voxel's own
  int max_steps = 400;
};

/// A point on a traced centreline.
struct TracePoint {
  VoxelIndex voxel;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  int votes = 0;
  double radius_m = 0.0;  ///< mean distance from which the votes came
};

/// The paper's isInsideTube, which it calls and does not define: at least a quarter of the start's votes, and the step
/// that led here within π/3 of the direction.
bool is_inside_tube(int votes, int start_votes, const Eigen::Vector3d& step, const Eigen::Vector3d& direction);

/// Algorithm 2, `trackPatchCenter`, from `start` along its axis or (`in_front` false) against it. The first point is
/// the start; the last one that is not inside the tube is left out.
RecycledVector<TracePoint> trace_one_way(const AccumulationMap& map, const VoxelIndex& start, bool in_front,
                                         const TraceOptions& options);

/// A line runs smoothly where it turns by less than this (a cosine) from step to step, and votes come from one radius
/// to within this part of it.
inline constexpr double kSmoothTurn = 0.82, kOneRadius = 0.25;

/// Lengthens a line at its end by what a few votes tell of a tube of its radius that goes on there, across gaps of
/// three steps at most. Of three points or more.
void trace_on(const AccumulationMap& map, double radius_m, int least_votes, const TraceOptions& options,
              RecycledVector<Eigen::Vector3d>& line_m);

/// Both ways from the start, one line from end to end. At least the start itself.
RecycledVector<TracePoint> trace_both_ways(const AccumulationMap& map, const VoxelIndex& start,
                                           const TraceOptions& options);

}  // namespace tubetrack
