#include "tubetrack/tracker/accumulation_map.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "visit_box.hpp"

namespace tubetrack {

namespace {

constexpr int kFractionBits = 12;
constexpr double kOne = 1 << kFractionBits;
constexpr int kMomentShift = 5;  // directions enter the moments in 1/128
constexpr std::int64_t kRound = std::int64_t{1} << 32;
constexpr std::int32_t kMostWeight = 1 << 16;  // of a vote whose moments have 32 bits; more is cast in parts

/// std::lround, which is a call; where the integer fits.
std::int32_t rounded(double value) {
  const auto whole = static_cast<std::int32_t>(value);
  const double rest = value - whole;
  return whole + (rest >= 0.5 ? 1 : 0) - (rest <= -0.5 ? 1 : 0);
}

VoxelIndex voxel_at_step(const VoteRecord& r, int step) {
  const auto at = [&](std::size_t axis) { return (r.origin[axis] + step * r.direction[axis]) >> kFractionBits; };
  return {at(2), at(1), at(0)};
}

/// The moments that each step of a record adds to its voxel, `weight` up to kMostWeight.
std::array<std::int32_t, 6> moments_of(const VoteRecord& record, std::int32_t weight) {
  // To the nearest: rounding down would tilt the axis of a tube seen from one side by up to 0.3°.
  const auto shifted = [](std::int32_t value) { return (value + (1 << kMomentShift) / 2) >> kMomentShift; };
  const std::int32_t dx = shifted(record.direction[0]);
  const std::int32_t dy = shifted(record.direction[1]);
  const std::int32_t dz = shifted(record.direction[2]);
  return {weight * dx * dx, weight * dx * dy, weight * dx * dz, weight * dy * dy, weight * dy * dz, weight * dz * dz};
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
    record.origin[i] = rounded(surfel.position_m[axis] / cell_m * kOne);
    record.direction[i] = rounded(surfel.inward_normal[axis] * kOne);
  }
  record.first_step = static_cast<std::int16_t>(rounded(surfel.radius_min_m / cell_m));
  record.last_step = static_cast<std::int16_t>(rounded(surfel.radius_max_m / cell_m));
  return record;
}

AccumulationMap::AccumulationMap(double cell_m) : cell_m_(cell_m) {
  // Room for a busy scene, so that its frames ask for none. What is never used takes no memory.
  constexpr std::size_t kBlocks = 1 << 14;
  constexpr std::size_t kVoxels = 1 << 17;
  table_.reserve(kBlocks);
  blocks_.reserve(kBlocks);
  free_blocks_.reserve(kBlocks);
  voxels_.reserve(kVoxels);
  votes_.reserve(kVoxels);
  free_voxels_.reserve(kVoxels);
  changed_.reserve(2 * kBlocks);
  stale_.reserve(kBlocks);
  box_votes_of_.reserve(kVoxels);
  peaks_.reserve(kBlocks);
  peak_voxels_.reserve(kBlocks);
}

void AccumulationMap::restart(double cell_m) {
  clear();
  cell_m_ = cell_m;
}

void AccumulationMap::clear() {
  table_.clear();
  for (Block& block : blocks_) block.filled = 0;
  free_blocks_.resize(blocks_.size());
  std::iota(free_blocks_.rbegin(), free_blocks_.rend(), 0);  // taken from the back, in the order of memory
  free_voxels_.clear();
  voxels_.clear();
  votes_.clear();
  carried_.clear();
  changed_.clear();
  min_votes_ = -1;  // nothing that was remembered holds
}

/// The block at `key`, or, where there is none, a fresh one.
std::int32_t AccumulationMap::find_or_make(const VoxelIndex& key) {
  const std::int32_t known = table_.find(key);
  if (known != BlockTable::kNone) return known;
  auto at = static_cast<std::int32_t>(blocks_.size());
  if (free_blocks_.empty()) {
    blocks_.emplace_back();
  } else {
    at = free_blocks_.back();
    free_blocks_.pop_back();
  }
  table_.insert(key, at);
  Block& fresh = blocks_[static_cast<std::size_t>(at)];
  fresh.key = key;
  fresh.filled = 0;
  fresh.changed = false;
  return at;
}

AccumulationMap::Block& AccumulationMap::take_block(const VoxelIndex& key) {
  // Surfels side by side vote in the same blocks. Only a block that stands somewhere is filled.
  std::size_t& recent = recent_[static_cast<std::size_t>(bit_of(key))];
  if (recent >= blocks_.size() || blocks_[recent].key != key || blocks_[recent].filled == 0) {
    recent = static_cast<std::size_t>(find_or_make(key));
  }
  Block& block = blocks_[recent];
  if (!block.changed) changed_.push_back(key);
  block.changed = true;
  return block;
}

void AccumulationMap::leave_if_empty(const Block& block) {
  if (block.filled != 0) return;
  free_blocks_.push_back(static_cast<std::int32_t>(&block - blocks_.data()));
  table_.erase(block.key);
}

/// Where a voxel that was all 0 stands from now on.
std::uint32_t AccumulationMap::fill(Block& block, int bit) {
  block.filled |= std::uint64_t{1} << bit;
  std::uint32_t& place = block.place[static_cast<std::size_t>(bit)];
  if (free_voxels_.empty()) {
    place = static_cast<std::uint32_t>(voxels_.size());
    voxels_.emplace_back();
    votes_.push_back(0);
  } else {  // it is all 0
    place = free_voxels_.back();
    free_voxels_.pop_back();
  }
  return place;
}

void AccumulationMap::leave_if_nothing(Block& block, int bit) {
  const std::uint32_t place = block.place[static_cast<std::size_t>(bit)];
  if (!is_nothing(place)) return;
  block.filled &= ~(std::uint64_t{1} << bit);
  free_voxels_.push_back(place);
}

/// Where a moment went round when `one` was added: what it lacks.
void AccumulationMap::carry(std::uint32_t place, const NarrowVoxel& one) {
  for (std::size_t i = 0; i < one.moments.size(); ++i) {
    const std::int64_t sum = voxels_[place].moments[i], more = one.moments[i];
    const std::int64_t lacks = sum - more > INT32_MAX ? -kRound : sum - more < INT32_MIN ? kRound : 0;
    const std::uint64_t at = one.moments.size() * std::uint64_t{place} + i;
    if (lacks == 0) continue;
    std::int64_t& carried = carried_[at];
    carried += lacks;
    if (carried == 0) carried_.erase(at);
  }
}

void AccumulationMap::add_to(Voxel& sum, std::uint32_t place) const {
  const NarrowVoxel& voxel = voxels_[place];
  sum.votes += votes_[place];
  sum.steps += voxel.steps;
  for (std::size_t i = 0; i < sum.moments.size(); ++i) sum.moments[i] += voxel.moments[i];
  for (std::size_t i = 0; i < sum.moments.size() && !carried_.empty(); ++i) {
    const auto carried = carried_.find(sum.moments.size() * std::uint64_t{place} + i);
    if (carried != carried_.end()) sum.moments[i] += carried->second;
  }
}

bool AccumulationMap::is_nothing(std::uint32_t place) const {
  Voxel voxel;
  add_to(voxel, place);
  return voxel == Voxel{};
}

void AccumulationMap::cast(const VoteRecord& record, int sign) {
  for (std::int64_t left = std::int64_t{sign} * record.weight; left != 0;) {
    const auto part = static_cast<std::int32_t>(std::clamp<std::int64_t>(left, -kMostWeight, kMostWeight));
    cast_part(record, part);
    left -= part;
  }
}

void AccumulationMap::cast_part(const VoteRecord& record, std::int32_t weight) {
  if (record.first_step > record.last_step) return;
  NarrowVoxel one{0, moments_of(record, weight)};
  VoxelIndex last = voxel_at_step(record, record.first_step);
  Block* block = &take_block(block_key(last));
  for (int step = record.first_step; step <= record.last_step; ++step) {
    const VoxelIndex index = voxel_at_step(record, step);
    const auto differs = static_cast<std::uint32_t>((index.z ^ last.z) | (index.y ^ last.y) | (index.x ^ last.x));
    if (differs == 0 && step > record.first_step) continue;
    last = index;
    if (differs >= 4) {  // in more than the lowest two bits: another block
      leave_if_empty(*block);
      block = &take_block(block_key(index));
    }
    // All here, and what is rare elsewhere: a call for each voxel would take as long.
    const int bit = bit_of(index);
    const bool is_filled = (block->filled >> bit & 1) != 0;
    const std::uint32_t place = is_filled ? block->place[static_cast<std::size_t>(bit)] : fill(*block, bit);
    one.steps = weight * step;
    votes_[place] += weight;
    if (voxels_[place].add(one)) carry(place, one);
    if (votes_[place] == 0) leave_if_nothing(*block, bit);
  }
  leave_if_empty(*block);
}

Voxel AccumulationMap::at(const VoxelIndex& index) const {
  const std::int32_t at = table_.find(block_key(index));
  if (at == BlockTable::kNone) return {};
  const Block& block = blocks_[static_cast<std::size_t>(at)];
  const int bit = bit_of(index);
  Voxel voxel;
  if ((block.filled >> bit & 1) != 0) add_to(voxel, block.place[static_cast<std::size_t>(bit)]);
  return voxel;
}

Voxel AccumulationMap::box(const VoxelIndex& index, int half) const {
  Voxel sum;
  visit_box(index, half, [&](const Block& block, int bit) { add_to(sum, block.place[static_cast<std::size_t>(bit)]); });
  return sum;
}

int AccumulationMap::box_votes(const VoxelIndex& index, int half) const {
  int sum = 0;
  visit_box(index, half,
            [&](const Block& block, int bit) { sum += votes_[block.place[static_cast<std::size_t>(bit)]]; });
  return sum;
}

VoxelIndex AccumulationMap::index_of(const Eigen::Vector3d& point_m) const {
  const auto at = [&](int axis) { return static_cast<int>(std::floor(point_m[axis] / cell_m_)); };
  return {at(2), at(1), at(0)};
}

Eigen::Vector3d AccumulationMap::center_of(const VoxelIndex& index) const {
  return Eigen::Vector3d(index.x + 0.5, index.y + 0.5, index.z + 0.5) * cell_m_;
}

}  // namespace tubetrack
