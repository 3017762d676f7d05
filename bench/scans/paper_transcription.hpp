#pragma once

// Algorithms 1 and 2 of the paper, transcribed line by line and slowly, to hold the accumulation map and the trace
// against. The paper's names are kept. What it leaves open: sign(0) = +1; a ray votes once in a voxel; faces have unit
// weight; isInsideTube as in is_inside_tube; ties go to the lowest voxel.

#include <functional>
#include <map>
#include <span>
#include <vector>

#include "tubetrack/tracker/accumulation_map.hpp"

namespace tubetrack::paper {

/// The images of algorithm 1; a voxel that is not in a map is 0 there.
struct Images {
  std::map<VoxelIndex, int> acc_image;
  std::map<VoxelIndex, Eigen::Vector3d> dir_image;
  std::map<VoxelIndex, Eigen::Vector3d> last_vectors;
  int max_acc = 0;
  VoxelIndex max_pt;
  VoxelIndex domain_lower;  ///< of the digital space, inclusive
  VoxelIndex domain_upper;

  int acc(const VoxelIndex& at) const;
  /// Normalised; zero where no two normals that differ crossed.
  Eigen::Vector3d dir(const VoxelIndex& at) const;
};

/// Algorithm 1, accumulationFromNormalVectors: face centres, normals and accRadius as the vote records have them (whole
/// steps of one voxel). The digital space ends `margin` voxels beyond the last vote.
Images accumulation_from_normal_vectors(std::span<const VoteRecord> faces, int margin, double min_norm = 0.1);

/// What algorithm 2 reads besides accImage.
struct TrackSettings {
  double cell_m = 0.0;
  double acc_radius_m = 0.0;
  double track_step_m = 0.0;
  std::function<Eigen::Vector3d(const VoxelIndex&)> dir;  ///< unit
  int max_points = 400;                                   ///< a tube that is a ring has no end
};

/// Algorithm 2, trackPatchCenter. As in the paper, the line's last point is the first that is no longer inside the
/// tube, unless the digital space ends before (`left_domain`).
struct Centerline {
  std::vector<VoxelIndex> points;
  bool left_domain = false;
};
Centerline track_patch_center(const Images& images, const VoxelIndex& start_pt, bool track_in_front,
                              const TrackSettings& settings);

}  // namespace tubetrack::paper
