#include "tubetrack/tracker/accumulation_map.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace tubetrack {

namespace {

constexpr int kFractionBits = 12;
constexpr double kOne = 1 << kFractionBits;
constexpr int kMomentShift = 5;  // directions enter the moments in 1/128

int local_index(const VoxelIndex& v) {
  return ((v.z & 7) * 8 + (v.y & 7)) * 8 + (v.x & 7);
}

VoxelIndex block_key(const VoxelIndex& v) {
  return {v.z >> 3, v.y >> 3, v.x >> 3};
}

VoxelIndex voxel_at_step(const VoteRecord& r, int step) {
  const auto at = [&](std::size_t axis) { return (r.origin[axis] + step * r.direction[axis]) >> kFractionBits; };
  return {at(2), at(1), at(0)};
}

}  // namespace

VoxelAxis axis_of(const Voxel& voxel) {
  Eigen::Matrix3d m;
  const auto& s = voxel.moments;
  const auto real = [&](std::size_t i) { return static_cast<double>(s[i]); };
  m << real(0), real(1), real(2), real(1), real(3), real(4), real(2), real(4), real(5);
  const double trace = m.trace();
  if (trace <= 0.0) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(m / trace);
  VoxelAxis axis;
  axis.direction = solver.eigenvectors().col(0);
  Eigen::Index largest = 0;
  axis.direction.cwiseAbs().maxCoeff(&largest);
  if (axis.direction[largest] < 0.0) axis.direction = -axis.direction;
  axis.spread = solver.eigenvalues()[1];
  axis.planar = solver.eigenvalues()[1] > 0.0 ? std::max(solver.eigenvalues()[0], 0.0) / solver.eigenvalues()[1] : 1.0;
  return axis;
}

VoteRecord vote_record(const Surfel& surfel, double cell_m) {
  VoteRecord record;
  constexpr double kMaxVoxels = (1 << (31 - kFractionBits)) - 1;
  constexpr double kMaxSteps = std::numeric_limits<std::int16_t>::max();
  const double farthest = surfel.position_m.cwiseAbs().maxCoeff() + std::max(surfel.radius_max_m, 0.0F);
  const bool fits = farthest / cell_m < kMaxVoxels && surfel.radius_max_m / cell_m < kMaxSteps;
  if (!fits || surfel.radius_min_m > surfel.radius_max_m) return record;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    record.origin[i] = static_cast<std::int32_t>(std::lround(surfel.position_m[axis] / cell_m * kOne));
    record.direction[i] = static_cast<std::int32_t>(std::lround(surfel.inward_normal[axis] * kOne));
  }
  record.first_step = static_cast<std::int16_t>(std::lround(surfel.radius_min_m / cell_m));
  record.last_step = static_cast<std::int16_t>(std::lround(surfel.radius_max_m / cell_m));
  return record;
}

AccumulationMap::AccumulationMap(double cell_m) : cell_m_(cell_m) {}

std::size_t AccumulationMap::Hash::operator()(const VoxelIndex& key) const {
  const auto mix = [](std::uint64_t h, int value) {
    h ^= static_cast<std::uint32_t>(value);
    h *= 0x9E3779B97F4A7C15ULL;
    return h ^ (h >> 29);
  };
  return static_cast<std::size_t>(mix(mix(mix(0x243F6A8885A308D3ULL, key.z), key.y), key.x));
}

const AccumulationMap::Block* AccumulationMap::block_at(const VoxelIndex& key) const {
  const auto found = block_of_.find(key);
  return found == block_of_.end() ? nullptr : &blocks_[found->second];
}

AccumulationMap::Block& AccumulationMap::take_block(const VoxelIndex& key) {
  const auto [entry, fresh] = block_of_.try_emplace(key, blocks_.size());
  if (fresh && free_blocks_.empty()) {
    blocks_.emplace_back();
  } else if (fresh) {
    entry->second = free_blocks_.back();
    free_blocks_.pop_back();
  }
  return blocks_[entry->second];
}

void AccumulationMap::leave_block(const VoxelIndex& key, const Block& block) {
  if (block.filled != 0) return;
  const auto entry = block_of_.find(key);
  free_blocks_.push_back(entry->second);
  block_of_.erase(entry);
}

void AccumulationMap::cast(const VoteRecord& record, int sign) {
  const std::int32_t weight = sign * record.weight;
  // Rounded to the nearest: rounding down would tilt the axis of a tube seen from one side by up to 0.3°.
  const auto rounded = [](std::int32_t value) { return (value + (1 << kMomentShift) / 2) >> kMomentShift; };
  const std::int64_t dx = rounded(record.direction[0]);
  const std::int64_t dy = rounded(record.direction[1]);
  const std::int64_t dz = rounded(record.direction[2]);
  Voxel vote{
      weight,
      0,
      {weight * dx * dx, weight * dx * dy, weight * dx * dz, weight * dy * dy, weight * dy * dz, weight * dz * dz}};
  VoxelIndex last{};
  VoxelIndex key{};
  Block* block = nullptr;
  for (int step = record.first_step; step <= record.last_step; ++step) {
    const VoxelIndex index = voxel_at_step(record, step);
    if (step > record.first_step && index == last) continue;
    last = index;
    if (const VoxelIndex here = block_key(index); !block || here != key) {
      if (block) leave_block(key, *block);
      key = here;
      block = &take_block(key);
    }
    const auto local = static_cast<std::size_t>(local_index(index));
    Voxel& voxel = block->voxels[local];
    const bool was_filled = voxel != Voxel{};
    const bool was_shared = voxel.votes > 1;
    vote.steps = weight * step;
    voxel += vote;
    block->votes[local] = voxel.votes;
    block->filled += static_cast<int>(voxel != Voxel{}) - static_cast<int>(was_filled);
    block->shared += static_cast<int>(voxel.votes > 1) - static_cast<int>(was_shared);
  }
  if (block) leave_block(key, *block);
}

Voxel AccumulationMap::at(const VoxelIndex& index) const {
  const Block* block = block_at(block_key(index));
  return block ? block->voxels[static_cast<std::size_t>(local_index(index))] : Voxel{};
}

Voxel AccumulationMap::box(const VoxelIndex& index, int half) const {
  Voxel sum;
  VoxelIndex key = block_key(index);
  const Block* block = block_at(key);
  for (int z = index.z - half; z <= index.z + half; ++z) {
    for (int y = index.y - half; y <= index.y + half; ++y) {
      for (int x = index.x - half; x <= index.x + half; ++x) {
        const VoxelIndex at{z, y, x};
        if (const VoxelIndex here = block_key(at); here != key) {
          key = here;
          block = block_at(key);
        }
        if (block) sum += block->voxels[static_cast<std::size_t>(local_index(at))];
      }
    }
  }
  return sum;
}

VoxelIndex AccumulationMap::index_of(const Eigen::Vector3d& point_m) const {
  const auto at = [&](int axis) { return static_cast<int>(std::floor(point_m[axis] / cell_m_)); };
  return {at(2), at(1), at(0)};
}

Eigen::Vector3d AccumulationMap::center_of(const VoxelIndex& index) const {
  return Eigen::Vector3d(index.x + 0.5, index.y + 0.5, index.z + 0.5) * cell_m_;
}

int AccumulationMap::box_votes(const VoxelIndex& index, int half) const {
  const VoxelIndex first{index.z - half, index.y - half, index.x - half};
  const VoxelIndex last{index.z + half, index.y + half, index.x + half};
  const VoxelIndex first_key = block_key(first);
  const VoxelIndex last_key = block_key(last);
  const auto within = [](int key, int low, int high) {
    return std::pair{std::max(low - key * kSide, 0), std::min(high - key * kSide, kSide - 1)};
  };
  int sum = 0;
  for (int bz = first_key.z; bz <= last_key.z; ++bz) {
    for (int by = first_key.y; by <= last_key.y; ++by) {
      for (int bx = first_key.x; bx <= last_key.x; ++bx) {
        const Block* block = block_at({bz, by, bx});
        if (!block) continue;
        const auto [z_first, z_last] = within(bz, first.z, last.z);
        const auto [y_first, y_last] = within(by, first.y, last.y);
        const auto [x_first, x_last] = within(bx, first.x, last.x);
        for (int z = z_first; z <= z_last; ++z) {
          for (int y = y_first; y <= y_last; ++y) {
            const std::int32_t* row = block->votes.data() + (z * kSide + y) * kSide;
            for (int x = x_first; x <= x_last; ++x) sum += row[x];
          }
        }
      }
    }
  }
  return sum;
}

std::vector<VoxelIndex> AccumulationMap::peaks(int min_votes, int box_half) const {
  struct Candidate {
    int votes;
    VoxelIndex index;
  };
  constexpr std::size_t kVoxels = kSide * kSide * kSide;
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  const int own_votes = std::max(1, min_votes / 6);
  std::vector<std::size_t> sums_of(blocks_.size(), kNone);  // where in `sums` a block's are
  std::vector<int> sums;                                    // of candidates; 0 elsewhere
  std::vector<Candidate> candidates;
  for (const auto& [key, block] : block_of_) {
    const Block& here = blocks_[block];
    if (own_votes > 1 && here.shared == 0) continue;
    for (int row = 0; row < kSide * kSide; ++row) {
      const std::int32_t* votes_in_row = here.votes.data() + row * kSide;
      int enough = 0;
      for (int x = 0; x < kSide; ++x) enough |= static_cast<int>(votes_in_row[x] >= own_votes);
      if (enough == 0) continue;
      for (int x = 0; x < kSide; ++x) {
        if (votes_in_row[x] < own_votes) continue;
        const VoxelIndex index{key.z * kSide + row / kSide, key.y * kSide + row % kSide, key.x * kSide + x};
        const int votes = box_votes(index, box_half);
        if (votes < min_votes) continue;
        if (sums_of[block] == kNone) {
          sums_of[block] = sums.size();
          sums.resize(sums.size() + kVoxels, 0);
        }
        sums[sums_of[block] + static_cast<std::size_t>(row * kSide + x)] = votes;
        candidates.push_back({votes, index});
      }
    }
  }
  const auto beaten = [&](const Candidate& candidate) {
    VoxelIndex key = block_key(candidate.index);
    auto block = block_of_.find(key);
    for (int i = 0; i < 27; ++i) {
      const VoxelIndex other{candidate.index.z + i / 9 - 1, candidate.index.y + i / 3 % 3 - 1,
                             candidate.index.x + i % 3 - 1};
      if (const VoxelIndex here = block_key(other); here != key) {
        key = here;
        block = block_of_.find(key);
      }
      if (block == block_of_.end() || sums_of[block->second] == kNone) continue;
      const int votes = sums[sums_of[block->second] + static_cast<std::size_t>(local_index(other))];
      if (votes > candidate.votes || (votes == candidate.votes && other < candidate.index)) return true;
    }
    return false;
  };
  std::erase_if(candidates, beaten);
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.votes != b.votes ? a.votes > b.votes : a.index < b.index;
  });
  std::vector<VoxelIndex> result;
  result.reserve(candidates.size());
  for (const Candidate& candidate : candidates) result.push_back(candidate.index);
  return result;
}

}  // namespace tubetrack
