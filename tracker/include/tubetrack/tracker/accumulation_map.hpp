#pragma once

#include <Eigen/Core>
#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <unordered_map>
#include <vector>

#include "tubetrack/heightmap/surfel.hpp"

namespace tubetrack {

/// Integer coordinates of a voxel; ordered by z, then y, then x, which breaks every tie.
struct VoxelIndex {
  int z = 0;
  int y = 0;
  int x = 0;
  auto operator<=>(const VoxelIndex&) const = default;
};

/// What one surfel voted: enough to withdraw the vote exactly. Lengths in 1/4096 of a voxel.
struct VoteRecord {
  std::array<std::int32_t, 3> origin{};     ///< x, y, z
  std::array<std::int32_t, 3> direction{};  ///< x, y, z; one voxel long
  std::int16_t first_step = 0;              ///< votes go to origin + k·direction, k from first_step …
  std::int16_t last_step = -1;              ///< … to last_step
  std::int32_t weight = 1;
  bool operator==(const VoteRecord&) const = default;
};

/// Sums over the votes of one voxel. All integers, so that any order of votes gives the same map.
struct Voxel {
  std::int32_t votes = 0;                 ///< accImage of the paper
  std::int32_t steps = 0;                 ///< Σ weight · step: steps / votes is the radius in voxels
  std::array<std::int64_t, 6> moments{};  ///< Σ weight · d dᵀ of the directions: xx, xy, xz, yy, yz, zz, in 1/128²

  Voxel& operator+=(const Voxel& other) {
    votes += other.votes;
    steps += other.steps;
    for (std::size_t i = 0; i < moments.size(); ++i) moments[i] += other.moments[i];
    return *this;
  }
  bool operator==(const Voxel&) const = default;
};

/// The tube's direction from a voxel's second moments: the unit eigenvector of the smallest eigenvalue (dirImage of the
/// paper, whose running cross products depend on the order of the faces), largest component positive.
struct VoxelAxis {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  double spread = 0.0;  ///< middle eigenvalue over their sum: 0 all votes parallel, 0.5 votes from all around
  double planar = 0.0;  ///< smallest over middle: 0 for a perfect tube
};
VoxelAxis axis_of(const Voxel& voxel);

/// Sparse 3D accumulation image (paper, section 2.1 and algorithm 1) in blocks of 8³ voxels.
class AccumulationMap {
 public:
  explicit AccumulationMap(double cell_m);

  double cell_m() const { return cell_m_; }
  /// Blocks that hold a vote; a block without is used again for another place.
  std::size_t block_count() const { return block_of_.size(); }
  /// One vote a voxel and record: steps that stay in a voxel count once.
  void add(const VoteRecord& record) { cast(record, 1); }
  void withdraw(const VoteRecord& record) { cast(record, -1); }

  /// The voxel, all zero where nothing was voted.
  Voxel at(const VoxelIndex& index) const;
  /// Sum over the (2·half + 1)³ voxels around.
  Voxel box(const VoxelIndex& index, int half) const;
  /// Its votes alone, which is quicker.
  int box_votes(const VoxelIndex& index, int half) const;
  VoxelIndex index_of(const Eigen::Vector3d& point_m) const;
  Eigen::Vector3d center_of(const VoxelIndex& index) const;

  /// Voxels with at least `min_votes` in their box and more than any voxel next to them (ties: the lower index wins),
  /// best first. Only voxels that hold a sixth of `min_votes` themselves (rounded down, at least one vote) take part:
  /// most hold a stray vote or none.
  std::vector<VoxelIndex> peaks(int min_votes, int box_half) const;

 private:
  static constexpr int kSide = 8;
  struct Block {
    std::array<Voxel, kSide * kSide * kSide> voxels{};
    std::array<std::int32_t, kSide * kSide * kSide> votes{};  ///< of the voxels, close together for peaks and trace
    int filled = 0;                                           ///< voxels that are not all 0
    int shared = 0;                                           ///< voxels with more than one vote
  };
  struct Hash {
    std::size_t operator()(const VoxelIndex& key) const;
  };

  void cast(const VoteRecord& record, int sign);
  const Block* block_at(const VoxelIndex& key) const;
  Block& take_block(const VoxelIndex& key);
  void leave_block(const VoxelIndex& key, const Block& block);

  double cell_m_;
  std::unordered_map<VoxelIndex, std::size_t, Hash> block_of_;
  std::deque<Block> blocks_;  // where it grows, nothing is moved
  std::vector<std::size_t> free_blocks_;
};

/// The record of a surfel's vote along its inward normal from radius_min_m to radius_max_m. A surfel too far away for
/// the grid (half a million voxels) votes nowhere.
VoteRecord vote_record(const Surfel& surfel, double cell_m);

}  // namespace tubetrack
