#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tubetrack {

/// Integer coordinates of a voxel, or of a block of voxels; ordered by z, then y, then x, which breaks every tie.
struct VoxelIndex {
  int z = 0;
  int y = 0;
  int x = 0;
  auto operator<=>(const VoxelIndex&) const = default;
};

/// Which block stands at which place: a hash table with open addressing. It asks for memory only where it holds more
/// than ever before; std::unordered_map would for every block.
class BlockTable {
 public:
  static constexpr std::int32_t kNone = -1;

  std::size_t size() const { return size_; }
  /// The block at `key`, or kNone.
  std::int32_t find(const VoxelIndex& key) const { return slots_[slot_of(key)]; }
  /// Where `find` says kNone. Blocks are small numbers, each at one place.
  void insert(const VoxelIndex& key, std::int32_t block);
  /// Where `find` finds one.
  void erase(const VoxelIndex& key);
  void clear();
  /// Room for the keys of so many blocks; for more it asks for memory.
  void reserve(std::size_t blocks) { keys_.reserve(blocks); }

 private:
  std::size_t home_of(const VoxelIndex& key) const {
    const auto part = [](int value) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(value)); };
    std::uint64_t h = part(key.z) * 0x9E3779B97F4A7C15ULL + part(key.y) * 0xC2B2AE3D27D4EB4FULL + part(key.x);
    h = (h ^ (h >> 32)) * 0xD6E8FEB86659FD93ULL;
    return static_cast<std::size_t>(h >> 32) & (slots_.size() - 1);
  }
  std::size_t slot_of(const VoxelIndex& key) const {
    std::size_t at = home_of(key);
    while (slots_[at] != kNone && key_of(slots_[at]) != key) at = (at + 1) & (slots_.size() - 1);
    return at;
  }
  const VoxelIndex& key_of(std::int32_t block) const { return keys_[static_cast<std::size_t>(block)]; }

  // Apart from the keys, so that the many searches for what is not there read little.
  std::vector<std::int32_t> slots_ = std::vector<std::int32_t>(1024, kNone);  // a power of two, at most half full
  std::vector<VoxelIndex> keys_;                                              // by block
  std::size_t size_ = 0;
};

}  // namespace tubetrack
