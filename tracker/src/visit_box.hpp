#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "tubetrack/tracker/accumulation_map.hpp"

namespace tubetrack {

/// A voxel's bit in its block.
inline int bit_of(const VoxelIndex& v) {
  return ((v.z & 3) * 4 + (v.y & 3)) * 4 + (v.x & 3);
}

inline VoxelIndex block_key(const VoxelIndex& v) {
  return {v.z >> 2, v.y >> 2, v.x >> 2};
}

/// The voxel of a bit in the block at `key`.
inline VoxelIndex voxel_at_bit(const VoxelIndex& key, int bit) {
  return {4 * key.z + bit / 16, 4 * key.y + bit / 4 % 4, 4 * key.x + bit % 4};
}

/// For any choice of a block's four slices across an axis (bit i: the i-th), their voxels' bits.
struct SliceBits {
  std::array<std::uint64_t, 16> z{}, y{}, x{};

  constexpr SliceBits() {
    for (std::size_t choice = 0; choice < 16; ++choice) {
      for (std::size_t i = 0; i < 4; ++i) {
        if ((choice >> i & 1) == 0) continue;
        z[choice] |= std::uint64_t{0xFFFF} << (16 * i);
        y[choice] |= std::uint64_t{0x000F'000F'000F'000F} << (4 * i);
        x[choice] |= std::uint64_t{0x1111'1111'1111'1111} << i;
      }
    }
  }
};
inline constexpr SliceBits kSliceBits;

/// Of the block that is the `key`-th along an axis, the slices up to `half` from voxel `middle`; at least one is.
inline std::size_t slices_of_box(int key, int middle, int half) {
  const int first = std::max(middle - half - 4 * key, 0);
  const int last = std::min(middle + half - 4 * key, 3);
  return static_cast<std::size_t>((15 << first) & (15 >> (3 - last)));
}

/// The bits of a block's voxels that are in a box, which meets it.
inline std::uint64_t bits_of_box(const VoxelIndex& key, const VoxelIndex& middle, int half) {
  return kSliceBits.z[slices_of_box(key.z, middle.z, half)] & kSliceBits.y[slices_of_box(key.y, middle.y, half)] &
         kSliceBits.x[slices_of_box(key.x, middle.x, half)];
}

/// Calls `visit(block, bit)` for every filled voxel of the (2·half + 1)³ around one.
template <typename Visit>
void AccumulationMap::visit_box(const VoxelIndex& index, int half, const Visit& visit) const {
  const VoxelIndex first = block_key({index.z - half, index.y - half, index.x - half});
  const VoxelIndex last = block_key({index.z + half, index.y + half, index.x + half});
  for (int z = first.z; z <= last.z; ++z) {
    for (int y = first.y; y <= last.y; ++y) {
      for (int x = first.x; x <= last.x; ++x) {
        const std::int32_t at = table_.find({z, y, x});
        if (at == BlockTable::kNone) continue;
        const Block& block = blocks_[static_cast<std::size_t>(at)];
        std::uint64_t bits = block.filled & bits_of_box({z, y, x}, index, half);
        for (; bits != 0; bits &= bits - 1) visit(block, std::countr_zero(bits));
      }
    }
  }
}

}  // namespace tubetrack
