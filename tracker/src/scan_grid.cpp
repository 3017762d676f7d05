#include "scan_grid.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "scan_cells.hpp"

namespace tubetrack {

namespace {

/// A surfel and its cell as one number: the bucket in the upper bits, the cell within it in the lower six.
struct CellMember {
  std::uint64_t key = 0;
  std::uint32_t surfel = 0;
};

/// By key, equal ones in the order that they came in: counted out, some dozen bits at a time. With std::sort two of the
/// scans of docs/paper.md miss their time. `spare` is for what is sorted in between.
void sort_by_key(int bits, std::vector<CellMember>& members, std::vector<CellMember>& spare) {
  constexpr int kMostDigit = 13;
  const int rounds = (bits + kMostDigit - 1) / kMostDigit, digit_bits = (bits + rounds - 1) / rounds;
  spare.resize(members.size());
  for (int shift = 0; shift < bits; shift += digit_bits) {
    std::array<std::uint32_t, (1 << kMostDigit) + 1> next{};
    const auto digit = [=](const CellMember& member) {
      return static_cast<std::size_t>(member.key >> shift) & ((std::size_t{1} << digit_bits) - 1);
    };
    for (const CellMember& member : members) ++next[digit(member) + 1];
    for (std::size_t i = 1; i < next.size(); ++i) next[i] += next[i - 1];
    for (const CellMember& member : members) spare[next[digit(member)]++] = member;
    members.swap(spare);
  }
}

CellKeys keys_of(const Eigen::AlignedBox3f& box, double cell_m) {
  CellKeys keys{1.0 / cell_m};
  const Cell low = cell_of(box.min(), keys.per_cell), high = cell_of(box.max(), keys.per_cell);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    keys.first_bucket[axis] = low[axis] >> kBucketBits;
    keys.bits[axis] = static_cast<int>(
        std::bit_width(static_cast<std::uint32_t>((high[axis] >> kBucketBits) - keys.first_bucket[axis])));
  }
  return keys;
}

/// Numbers of surfels in shares of whole cells, by key from one share to the next, so that not all have to be sorted at
/// once: what a large scan's take then is a few megabytes.
struct Shares {
  std::vector<std::uint32_t> surfels;  // empty where one share holds all
  std::vector<std::size_t> ends;
};

template <typename AnySurfel>
Shares shares_of(std::span<const AnySurfel> surfels, std::span<const char> left_out, const CellKeys& keys,
                 std::size_t count) {
  constexpr std::size_t kShare = 1 << 17;
  constexpr int kBits = 16;
  Shares shares;
  if (count <= 2 * kShare) return shares;
  const int shift = std::max(0, keys.all_bits() - kBits);
  std::vector<std::uint32_t> next((std::size_t{1} << kBits) + 1, 0);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (left_out.empty() || left_out[i] == 0) ++next[(keys.of(surfels[i].position_m) >> shift) + 1];
  }
  std::size_t begin = 0;
  for (std::size_t i = 1; i < next.size(); ++i) {
    next[i] += next[i - 1];
    if (next[i] - begin < kShare && i + 1 < next.size()) continue;
    shares.ends.push_back(begin = next[i]);
  }
  shares.surfels.resize(count);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (left_out.empty() || left_out[i] == 0)
      shares.surfels[next[keys.of(surfels[i].position_m) >> shift]++] = static_cast<std::uint32_t>(i);
  }
  return shares;
}

Eigen::Vector3d center_of_bucket(std::uint64_t key, const SurfelGrid& grid) {
  Eigen::Vector3d center_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<std::int32_t>(key & ((std::uint64_t{1} << grid.bits[axis]) - 1));
    key >>= grid.bits[axis];
    center_m[static_cast<Eigen::Index>(axis)] =
        grid.cell_m * ((at + grid.first_bucket[axis] - kFirstBucket + 0.5) * (1 << kBucketBits));
  }
  return center_m;
}

/// Sums of products, xx … zz.
struct SpreadSums {
  std::array<double, 6> sums{};

  void add(double weight, const Eigen::Vector3d& off_m) {
    std::size_t k = 0;
    for (Eigen::Index i = 0; i < 3; ++i) {
      for (Eigen::Index j = i; j < 3; ++j) sums[k++] += weight * off_m[i] * off_m[j];
    }
  }
};

const SurfelSpread* spread_of(const ScanSurfel& /*surfel*/) {
  return nullptr;
}

const SurfelSpread* spread_of(const CellSurfel& surfel) {
  return &surfel.spread;
}

/// Sums over surfels of one cell, places by their way from the first.
struct CellSums {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
  double weight = 0.0;
  SpreadSums products;

  template <typename AnySurfel>
  void add(const AnySurfel& surfel, const Eigen::Vector3d& off_m) {
    const double own = surfel.weight;
    position_m += own * off_m;
    normal += own * surfel.inward_normal.template cast<double>();
    products.add(own, off_m);
    if (const SurfelSpread* spread = spread_of(surfel)) {
      for (std::size_t k = 0; k < spread->size(); ++k) products.sums[k] += own * (*spread)[k];
    }
    weight += own;
  }
};

/// Those that `belongs` says yes to.
template <typename AnySurfel, typename Belongs>
CellSums sums_of(std::span<const AnySurfel> surfels, std::span<const CellMember> members, const Belongs& belongs) {
  const Eigen::Vector3f origin_m = surfels[members.front().surfel].position_m;
  CellSums sums;
  for (const CellMember& member : members) {
    const AnySurfel& surfel = surfels[member.surfel];
    if (belongs(surfel)) sums.add(surfel, surfel.position_m.template cast<double>() - origin_m.cast<double>());
  }
  return sums;
}

/// Weight 0 where the surfels cancel out.
template <typename AnySurfel>
CellSurfel mean_of(std::span<const AnySurfel> surfels, std::span<const CellMember> members) {
  const AnySurfel& first = surfels[members.front().surfel];
  CellSurfel mean{first.position_m, first.inward_normal, first.weight};
  if (const SurfelSpread* own = spread_of(first)) mean.spread = *own;
  if (members.size() == 1) return mean;
  CellSums sums = sums_of(surfels, members, [](const AnySurfel& /*surfel*/) { return true; });
  const double length = sums.normal.norm();
  if (!(sums.weight > 0.0) || !(length > 1e-6 * sums.weight)) {
    mean.weight = 0.0F;
    return mean;
  }
  // Both walls of a pipe: the outer one, which is larger, stays where it is, with what it has more.
  constexpr double kBothWalls = 0.95;
  if (length < kBothWalls * sums.weight) {
    sums = sums_of(surfels, members, [outward = sums.normal](const AnySurfel& surfel) {
      return surfel.inward_normal.template cast<double>().dot(outward) >= 0.0;
    });
  }
  sums.position_m /= sums.weight;
  sums.products.add(-sums.weight, sums.position_m);
  for (std::size_t k = 0; k < mean.spread.size(); ++k)
    mean.spread[k] = static_cast<float>(sums.products.sums[k] / sums.weight);
  mean.position_m = (first.position_m.template cast<double>() + sums.position_m).template cast<float>();
  mean.inward_normal = sums.normal.normalized().template cast<float>();
  mean.weight = static_cast<float>(length);
  return mean;
}

/// A cell's bit in its bucket.
std::uint64_t bit_of_cell(std::uint64_t key) {
  return std::uint64_t{1} << (key & ((1 << kFineBits) - 1));
}

/// One surfel for each key of sorted members, which lie behind all that the grid has.
template <typename AnySurfel>
void add_cells(std::span<const AnySurfel> surfels, std::span<const CellMember> members, SurfelGrid& grid) {
  for (std::size_t begin = 0, end = 0; begin < members.size(); begin = end) {
    const std::uint64_t key = members[begin].key;
    while (end < members.size() && members[end].key == key) ++end;
    const CellSurfel mean = mean_of(surfels, members.subspan(begin, end - begin));
    if (!(mean.weight > 0.0F)) continue;
    const auto place = static_cast<std::uint32_t>(grid.surfels.size());
    if (grid.keys.empty() || key >> kFineBits != grid.keys.back()) {
      grid.keys.push_back(key >> kFineBits);
      grid.buckets.push_back({center_of_bucket(grid.keys.back(), grid), 0, place, place});
    }
    grid.surfels.push_back(mean);
    grid.buckets.back().end = place + 1;
    grid.buckets.back().cells |= bit_of_cell(key);
  }
}

template <typename AnySurfel>
SurfelGrid merged(std::span<const AnySurfel> surfels, std::span<const char> left_out, double cell_m) {
  SurfelGrid grid;
  grid.cell_m = cell_m;
  const auto is_in = [&](std::size_t i) { return left_out.empty() || left_out[i] == 0; };
  std::size_t count = 0;
  Eigen::AlignedBox3f box;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (!is_in(i)) continue;
    ++count;
    box.extend(surfels[i].position_m);
  }
  if (count == 0) return grid;
  const CellKeys keys = keys_of(box, cell_m);
  grid.first_bucket = keys.first_bucket;
  grid.bits = keys.bits;
  const Shares shares = shares_of(surfels, left_out, keys, count);
  std::vector<CellMember> members, spare;
  const auto add_member = [&](std::size_t i) {
    members.push_back({keys.of(surfels[i].position_m), static_cast<std::uint32_t>(i)});
  };
  const auto add_share = [&] {
    sort_by_key(keys.all_bits(), members, spare);
    add_cells(surfels, std::span<const CellMember>(members), grid);
    members.clear();
  };
  if (shares.ends.empty()) {
    members.reserve(count);
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      if (is_in(i)) add_member(i);
    }
    add_share();
  }
  std::size_t begin = 0;
  for (const std::size_t end : shares.ends) {
    for (std::size_t i = begin; i < end; ++i) add_member(shares.surfels[i]);
    add_share();
    // Growing by doubling would take twice the room of a large grid.
    if (begin == 0) {
      constexpr double kMore = 1.1;
      const double shares_to_come = kMore * static_cast<double>(count) / static_cast<double>(end);
      grid.surfels.reserve(static_cast<std::size_t>(shares_to_come * static_cast<double>(grid.surfels.size())));
    }
    begin = end;
  }
  return grid;
}

}  // namespace

SurfelGrid merged_by_cell(std::span<const ScanSurfel> surfels, std::span<const char> left_out, double cell_m) {
  return merged(surfels, left_out, cell_m);
}

SurfelGrid merged_by_cell(std::span<const CellSurfel> surfels, double cell_m) {
  return merged(surfels, {}, cell_m);
}

}  // namespace tubetrack
