#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace tubetrack {

// Cells of a SurfelGrid, counted along its axes, the cubes of 4³ that are its buckets, and both as one number.

inline constexpr int kBucketBits = 2;  // an axis: 4 cells
inline constexpr int kFineBits = 3 * kBucketBits;
inline constexpr int kHalfCells = 1 << 20;  // cells to either side of zero
inline constexpr int kFirstBucket = kHalfCells >> kBucketBits;

using Cell = std::array<std::int32_t, 3>;

/// What lies farther out than a million cells is put into the outermost.
inline Cell cell_of(const Eigen::Vector3f& position_m, double per_cell) {
  Cell cell{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = static_cast<double>(position_m[static_cast<Eigen::Index>(axis)]) * per_cell;
    // Above zero a number is rounded down where it is cut off.
    cell[axis] = static_cast<std::int32_t>(std::clamp(at + kHalfCells, 0.0, 2.0 * kHalfCells - 1.0));
  }
  return cell;
}

inline Cell bucket_of(const Cell& cell) {
  return {cell[0] >> kBucketBits, cell[1] >> kBucketBits, cell[2] >> kBucketBits};
}

/// The cell within its bucket.
inline std::uint64_t fine_key(const Cell& cell) {
  constexpr std::int32_t kMask = (1 << kBucketBits) - 1;
  return static_cast<std::uint64_t>(((cell[2] & kMask) << kBucketBits | (cell[1] & kMask)) << kBucketBits |
                                    (cell[0] & kMask));
}

/// How places become keys.
struct CellKeys {
  double per_cell = 1.0;
  Cell first_bucket{}, bits{};  // as SurfelGrid has them

  int all_bits() const { return bits[0] + bits[1] + bits[2] + kFineBits; }
  std::uint64_t of_bucket(const Cell& bucket) const {
    std::uint64_t key = 0;
    for (std::size_t axis = 3; axis-- > 0;)
      key = key << bits[axis] | static_cast<std::uint64_t>(bucket[axis] - first_bucket[axis]);
    return key;
  }
  std::uint64_t of(const Eigen::Vector3f& position_m) const {
    const Cell cell = cell_of(position_m, per_cell);
    return of_bucket(bucket_of(cell)) << kFineBits | fine_key(cell);
  }
};

}  // namespace tubetrack
