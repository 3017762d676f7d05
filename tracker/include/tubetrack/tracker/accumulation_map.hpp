#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/tracker/block_table.hpp"

namespace tubetrack {

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

/// Sparse 3D accumulation image (paper, section 2.1 and algorithm 1). Few voxels near a surface hold a vote, so a block
/// of 4³ has a bit for each that does, and their sums stand close together elsewhere.
class AccumulationMap {
 public:
  explicit AccumulationMap(double cell_m);

  double cell_m() const { return cell_m_; }
  /// Blocks that hold a vote; a block without is used again for another place.
  std::size_t block_count() const { return table_.size(); }
  /// One vote a voxel and record: steps that stay in a voxel count once.
  void add(const VoteRecord& record) { cast(record, 1); }
  void withdraw(const VoteRecord& record) { cast(record, -1); }
  /// Withdraws everything. Memory is kept.
  void clear();
  /// The same, and from now on with voxels of another size.
  void restart(double cell_m);

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
  /// most hold a stray vote or none. Remembers what it found: asked the same again, it looks only where votes changed.
  /// Valid until the next call.
  const std::vector<VoxelIndex>& peaks(int min_votes, int box_half);
  /// Of the i-th of them, as long as no vote has changed since: the votes in its box, and the spread of their axis. The
  /// spread is found when it is asked for and remembered as long as the peak is.
  int peak_votes(std::size_t i) const { return peaks_[i].votes; }
  double peak_spread(std::size_t i);

 private:
  struct Block {
    VoxelIndex key;
    std::uint64_t filled = 0;                      ///< a bit for each voxel that is not all 0
    bool changed = false;                          ///< since the last peaks; then it is among `changed_`
    bool stale = false;                            ///< while they are looked for: it or a block beside it changed
    std::array<std::uint32_t, 4 * 4 * 4> place{};  ///< where in `voxels_` the filled ones are
  };
  /// A voxel but for its votes, in half the room: hardly any holds a moment of more than 32 bits.
  struct NarrowVoxel {
    std::int32_t steps = 0;
    std::array<std::int32_t, 6> moments{};
    bool operator==(const NarrowVoxel&) const = default;

    /// True where a moment went round.
    bool add(const NarrowVoxel& one) {
      steps += one.steps;
      std::uint32_t beyond = 0;  // the upper bit says that a moment was
      for (std::size_t i = 0; i < moments.size(); ++i) {
        const auto before = static_cast<std::uint32_t>(moments[i]), more = static_cast<std::uint32_t>(one.moments[i]);
        const std::uint32_t sum = before + more;
        beyond |= (before ^ sum) & (more ^ sum);
        moments[i] = static_cast<std::int32_t>(sum);
      }
      return beyond >> 31 != 0;
    }
  };
  struct Peak {
    int votes = 0;
    VoxelIndex voxel;
    double spread = -1.0;  ///< of the axis of its box; negative until it was asked for
  };

  void cast(const VoteRecord& record, int sign);
  void cast_part(const VoteRecord& record, std::int32_t weight);
  std::uint32_t fill(Block& block, int bit);
  void leave_if_nothing(Block& block, int bit);
  void carry(std::uint32_t place, const NarrowVoxel& one);
  void add_to(Voxel& sum, std::uint32_t place) const;
  bool is_nothing(std::uint32_t place) const;
  std::int32_t find_or_make(const VoxelIndex& key);
  Block& take_block(const VoxelIndex& key);
  void leave_if_empty(const Block& block);
  template <typename Visit>
  void visit_box(const VoxelIndex& index, int half, const Visit& visit) const;

  void mark_stale(std::int32_t block);
  void gather_stale(int min_votes, int box_half);
  void sum_boxes(const Block& block);
  bool is_beaten(const Block& block, int bit) const;
  void add_peaks(const Block& block);

  double cell_m_;
  BlockTable table_;
  std::vector<Block> blocks_;
  std::vector<std::int32_t> free_blocks_;
  std::array<std::size_t, 4 * 4 * 4> recent_{};  // blocks, by the lowest bits of their keys
  std::vector<NarrowVoxel> voxels_;
  std::vector<std::int32_t> votes_;                          // of the voxels, close together for sums over boxes
  std::unordered_map<std::uint64_t, std::int64_t> carried_;  // by 6 · place + moment: what 32 bits leave of one
  std::vector<std::uint32_t> free_voxels_;

  // What `peaks` remembers.
  int min_votes_ = -1;
  int box_half_ = -1;
  std::vector<VoxelIndex> changed_;         // keys of blocks that changed since, some of them gone
  std::vector<std::int32_t> stale_;         // blocks whose peaks are looked for anew
  std::vector<std::int32_t> box_votes_of_;  // by place in `voxels_`: of those that take part, otherwise 0
  std::vector<Peak> peaks_;                 // best first
  std::vector<VoxelIndex> peak_voxels_;
};

/// The record of a surfel's vote along its inward normal from radius_min_m to radius_max_m. A surfel too far away for
/// the grid (half a million voxels) votes nowhere.
VoteRecord vote_record(const Surfel& surfel, double cell_m);

}  // namespace tubetrack
