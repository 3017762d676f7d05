#include <algorithm>
#include <bit>

#include "visit_box.hpp"

namespace tubetrack {

namespace {

/// A peak depends on votes up to here around it: its box, and those of the voxels next to it. No farther than a block.
constexpr int kLargestHalf = 3;

}  // namespace

void AccumulationMap::mark_stale(std::int32_t block) {
  if (block == BlockTable::kNone || blocks_[static_cast<std::size_t>(block)].stale) return;
  blocks_[static_cast<std::size_t>(block)].stale = true;
  stale_.push_back(block);
}

/// Collects in `stale_` the blocks whose peaks may not be those that are remembered.
void AccumulationMap::gather_stale(int min_votes, int box_half) {
  stale_.clear();
  const bool same = min_votes == min_votes_ && box_half == box_half_ && box_half <= kLargestHalf;
  min_votes_ = min_votes;
  box_half_ = box_half;
  // With as many blocks around them as there are, it is quicker to look at all.
  const bool all = !same || changed_.size() > table_.size() / 8;
  for (std::size_t at = 0; all && at < blocks_.size(); ++at) {
    blocks_[at].changed = false;
    if (blocks_[at].filled != 0) mark_stale(static_cast<std::int32_t>(at));
  }
  for (std::size_t i = 0; !all && i < changed_.size(); ++i) {
    const VoxelIndex key = changed_[i];
    for (int k = 0; k < 27; ++k) mark_stale(table_.find({key.z + k / 9 - 1, key.y + k / 3 % 3 - 1, key.x + k % 3 - 1}));
    if (const std::int32_t at = table_.find(key); at != BlockTable::kNone) {
      blocks_[static_cast<std::size_t>(at)].changed = false;
    }
  }
  changed_.clear();
}

/// The sums over boxes of a block's voxels that take part; 0 of the others.
void AccumulationMap::sum_boxes(const Block& block) {
  const int own_votes = std::max(1, min_votes_ / 6);
  for (std::uint64_t bits = block.filled; bits != 0; bits &= bits - 1) {
    const int bit = std::countr_zero(bits);
    const std::uint32_t place = block.place[static_cast<std::size_t>(bit)];
    int votes = 0;
    if (votes_[place] >= own_votes) votes = box_votes(voxel_at_bit(block.key, bit), box_half_);
    box_votes_of_[place] = votes >= min_votes_ ? votes : 0;
  }
}

bool AccumulationMap::is_beaten(const Block& block, int bit) const {
  const int votes = box_votes_of_[block.place[static_cast<std::size_t>(bit)]];
  const VoxelIndex index = voxel_at_bit(block.key, bit);
  const auto beats = [&](const Block& other, int at) {
    const int its = box_votes_of_[other.place[static_cast<std::size_t>(at)]];
    return its > votes || (its == votes && voxel_at_bit(other.key, at) < index);
  };
  // Most are beaten in their own block, which needs no search for others.
  for (std::uint64_t bits = block.filled & bits_of_box(block.key, index, 1); bits != 0; bits &= bits - 1) {
    if (beats(block, std::countr_zero(bits))) return true;
  }
  bool beaten = false;
  visit_box(index, 1, [&](const Block& other, int at) { beaten = beaten || beats(other, at); });
  return beaten;
}

void AccumulationMap::add_peaks(const Block& block) {
  for (std::uint64_t bits = block.filled; bits != 0; bits &= bits - 1) {
    const int bit = std::countr_zero(bits);
    const int votes = box_votes_of_[block.place[static_cast<std::size_t>(bit)]];
    if (votes > 0 && !is_beaten(block, bit)) peaks_.push_back({.votes = votes, .voxel = voxel_at_bit(block.key, bit)});
  }
}

const std::vector<VoxelIndex>& AccumulationMap::peaks(int min_votes, int box_half) {
  gather_stale(min_votes, box_half);
  box_votes_of_.resize(voxels_.size());
  std::erase_if(peaks_, [&](const Peak& peak) {
    const std::int32_t at = table_.find(block_key(peak.voxel));
    return at == BlockTable::kNone || blocks_[static_cast<std::size_t>(at)].stale;
  });
  for (const std::int32_t at : stale_) sum_boxes(blocks_[static_cast<std::size_t>(at)]);
  for (const std::int32_t at : stale_) add_peaks(blocks_[static_cast<std::size_t>(at)]);
  for (const std::int32_t at : stale_) blocks_[static_cast<std::size_t>(at)].stale = false;
  std::sort(peaks_.begin(), peaks_.end(),
            [](const Peak& a, const Peak& b) { return a.votes != b.votes ? a.votes > b.votes : a.voxel < b.voxel; });
  peak_voxels_.clear();
  for (const Peak& peak : peaks_) peak_voxels_.push_back(peak.voxel);
  return peak_voxels_;
}

double AccumulationMap::peak_spread(std::size_t i) {
  Peak& peak = peaks_[i];
  if (peak.spread < 0.0) peak.spread = axis_of(box(peak.voxel, box_half_)).spread;
  return peak.spread;
}

}  // namespace tubetrack
