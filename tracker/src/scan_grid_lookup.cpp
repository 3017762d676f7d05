#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "scan_cells.hpp"
#include "scan_grid.hpp"

namespace tubetrack {

namespace {

/// Null where there is none.
const SurfelBucket* find_bucket(const SurfelGrid& grid, const CellKeys& keys, const Cell& bucket) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int32_t at = bucket[axis] - keys.first_bucket[axis];
    if (at < 0 || at >> keys.bits[axis] != 0) return nullptr;
  }
  const std::uint64_t key = keys.of_bucket(bucket);
  const auto found = std::lower_bound(grid.keys.begin(), grid.keys.end(), key);
  return found != grid.keys.end() && *found == key ? &grid.buckets[static_cast<std::size_t>(found - grid.keys.begin())]
                                                   : nullptr;
}

/// Of the bucket at a place, a bit for each cell whose surfel is flagged.
std::uint64_t flagged_cells(const SurfelGrid& grid, const CellKeys& keys, const Cell& bucket_at,
                            std::span<const char> flags) {
  const SurfelBucket* const bucket = find_bucket(grid, keys, bucket_at);
  if (bucket == nullptr) return 0;
  std::uint64_t flagged = 0;
  std::uint32_t surfel = bucket->begin;
  for (std::uint64_t cells = bucket->cells; cells != 0; cells &= cells - 1) {
    if (flags[surfel++] != 0) flagged |= cells & -cells;
  }
  return flagged;
}

template <typename AnySurfel>
void flag_all_of(const SurfelGrid& grid, std::span<const char> flags, std::span<const AnySurfel> surfels,
                 std::vector<char>& members) {
  struct Flagged {
    Cell bucket{-1, -1, -1};
    std::uint64_t cells = 0;
  };
  // By the lowest bits of their places: a scan goes around in circles, or along rows of an image.
  constexpr std::int32_t kRecentBits = 4;
  std::vector<Flagged> recent(std::size_t{1} << 3 * kRecentBits);
  const auto place_of = [](const Cell& bucket) {
    constexpr std::int32_t kMask = (1 << kRecentBits) - 1;
    return static_cast<std::size_t>(((bucket[2] & kMask) << kRecentBits | (bucket[1] & kMask)) << kRecentBits |
                                    (bucket[0] & kMask));
  };
  const CellKeys keys{1.0 / grid.cell_m, grid.first_bucket, grid.bits};
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (members[i] != 0) continue;
    const Cell cell = cell_of(surfels[i].position_m, keys.per_cell);
    const Cell bucket = bucket_of(cell);
    Flagged& flagged = recent[place_of(bucket)];
    if (flagged.bucket != bucket) flagged = {bucket, flagged_cells(grid, keys, bucket, flags)};
    members[i] = static_cast<char>(flagged.cells >> fine_key(cell) & 1);
  }
}

}  // namespace

double SurfelGrid::bucket_radius_m() const {
  return 0.5 * std::sqrt(3.0) * (1 << kBucketBits) * cell_m;
}

void SurfelGrid::buckets_in(const Eigen::AlignedBox3d& box, std::vector<std::uint32_t>& numbers) const {
  numbers.clear();
  if (box.isEmpty()) return;
  const double bucket_m = (1 << kBucketBits) * cell_m;
  Cell low{}, high{};
  double rows = 1.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto at = [&](double place_m, double most) {
      return static_cast<std::int32_t>(
          std::clamp(std::floor(place_m / bucket_m) + kFirstBucket - first_bucket[axis], 0.0, most));
    };
    const double most = (1 << bits[axis]) - 1;
    low[axis] = at(box.min()[static_cast<Eigen::Index>(axis)], most);
    high[axis] = at(box.max()[static_cast<Eigen::Index>(axis)], most);
    if (axis > 0) rows *= high[axis] - low[axis] + 1;
  }
  // To look for a row costs as much as a handful of buckets.
  constexpr double kOfRow = 8.0;
  if (kOfRow * rows > static_cast<double>(keys.size())) {
    numbers.resize(keys.size());
    std::iota(numbers.begin(), numbers.end(), 0U);
    return;
  }
  for (std::int32_t z = low[2]; z <= high[2]; ++z) {
    for (std::int32_t y = low[1]; y <= high[1]; ++y) {
      const auto row = (static_cast<std::uint64_t>(z) << bits[1] | static_cast<std::uint64_t>(y)) << bits[0];
      const auto last = row | static_cast<std::uint64_t>(high[0]);
      auto at = std::lower_bound(keys.begin(), keys.end(), row | static_cast<std::uint64_t>(low[0]));
      for (; at != keys.end() && *at <= last; ++at) numbers.push_back(static_cast<std::uint32_t>(at - keys.begin()));
    }
  }
}

void flag_members(const SurfelGrid& grid, std::span<const char> flags, std::span<const ScanSurfel> surfels,
                  std::vector<char>& members) {
  flag_all_of(grid, flags, surfels, members);
}

void flag_members(const SurfelGrid& grid, std::span<const char> flags, std::span<const CellSurfel> surfels,
                  std::vector<char>& members) {
  flag_all_of(grid, flags, surfels, members);
}

}  // namespace tubetrack
