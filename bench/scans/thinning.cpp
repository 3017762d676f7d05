#include "thinning.hpp"

#include <array>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace tubetrack::bench {

namespace {

/// The 27 voxels around one, itself at kCenter; x runs fastest.
using Block = std::array<bool, 27>;
constexpr int kCenter = 13;

int offset(int place, int axis) {
  return (axis == 0 ? place : axis == 1 ? place / 3 : place / 9) % 3 - 1;
}

bool is_inside(const VoxelGrid& grid, int i, int j, int k) {
  return grid.contains(i, j, k) && grid.inside[grid.at(i, j, k)] != 0;
}

Block block_at(const VoxelGrid& grid, int i, int j, int k) {
  Block block{};
  for (int place = 0; place < 27; ++place)
    block[static_cast<std::size_t>(place)] =
        is_inside(grid, i + offset(place, 0), j + offset(place, 1), k + offset(place, 2));
  return block;
}

/// Neighbours by faces (1 axis differs), by edges (up to 2) or by corners (up to 3).
bool adjacent(int a, int b, int most_axes) {
  int axes = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int apart = std::abs(offset(a, axis) - offset(b, axis));
    if (apart > 1) return false;
    axes += apart;
  }
  return axes > 0 && axes <= most_axes;
}

/// Connected parts of the places in `members` that have one for which `counts`.
template <class Counts>
int parts(Block members, int most_axes, Counts counts) {
  int found = 0;
  for (int first = 0; first < 27; ++first) {
    if (!members[static_cast<std::size_t>(first)]) continue;
    bool counted = false;
    std::vector<int> open{first};
    members[static_cast<std::size_t>(first)] = false;
    while (!open.empty()) {
      const int place = open.back();
      open.pop_back();
      counted = counted || counts(place);
      for (int next = 0; next < 27; ++next) {
        if (!members[static_cast<std::size_t>(next)] || !adjacent(place, next, most_axes)) continue;
        members[static_cast<std::size_t>(next)] = false;
        open.push_back(next);
      }
    }
    found += counted ? 1 : 0;
  }
  return found;
}

int neighbours(const Block& block) {
  int count = 0;
  for (int place = 0; place < 27; ++place) count += place != kCenter && block[static_cast<std::size_t>(place)] ? 1 : 0;
  return count;
}

/// Taking the middle away changes nothing: the body around it is one piece by corners, and so is the background by
/// faces, of what touches the middle with a face.
bool is_simple(const Block& block) {
  Block body = block, background{};
  body[kCenter] = false;
  if (parts(body, 3, [](int) { return true; }) != 1) return false;
  for (int place = 0; place < 27; ++place)
    background[static_cast<std::size_t>(place)] =
        !block[static_cast<std::size_t>(place)] && adjacent(place, kCenter, 2);
  return parts(background, 1, [](int place) { return adjacent(place, kCenter, 1); }) == 1;
}

/// One voxel layer from one side; whether anything went.
bool peel(VoxelGrid& grid, const Eigen::Vector3i& side) {
  std::vector<Eigen::Vector3i> candidates;
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      for (int i = 0; i < grid.size.x(); ++i) {
        if (is_inside(grid, i, j, k) && !is_inside(grid, i + side.x(), j + side.y(), k + side.z()))
          candidates.emplace_back(i, j, k);
      }
    }
  }
  bool peeled = false;
  for (const Eigen::Vector3i& at : candidates) {
    const Block block = block_at(grid, at.x(), at.y(), at.z());
    if (neighbours(block) <= 1 || !is_simple(block)) continue;
    grid.inside[grid.at(at.x(), at.y(), at.z())] = 0;
    peeled = true;
  }
  return peeled;
}

/// Connected parts of the voxels that are `value`, beyond the grid: background.
std::size_t pieces_of(const VoxelGrid& grid, bool value, int most_axes) {
  const Eigen::Vector3i size = grid.size + Eigen::Vector3i::Constant(2);
  const auto at = [&](const Eigen::Vector3i& p) {
    return (static_cast<std::size_t>(p.z()) * static_cast<std::size_t>(size.y()) + static_cast<std::size_t>(p.y())) *
               static_cast<std::size_t>(size.x()) +
           static_cast<std::size_t>(p.x());
  };
  std::vector<std::uint8_t> seen(at(size - Eigen::Vector3i::Ones()) + 1, 0);
  std::size_t found = 0;
  std::vector<Eigen::Vector3i> open;
  const auto visit = [&](const Eigen::Vector3i& p) {
    if ((p.array() < 0).any() || (p.array() >= size.array()).any() || seen[at(p)] != 0) return false;
    if (is_inside(grid, p.x() - 1, p.y() - 1, p.z() - 1) != value) return false;
    seen[at(p)] = 1;
    open.push_back(p);
    return true;
  };
  for (int k = 0; k < size.z(); ++k) {
    for (int j = 0; j < size.y(); ++j) {
      for (int i = 0; i < size.x(); ++i) {
        if (!visit({i, j, k})) continue;
        ++found;
        while (!open.empty()) {
          const Eigen::Vector3i p = open.back();
          open.pop_back();
          for (int place = 0; place < 27; ++place) {
            if (adjacent(place, kCenter, most_axes))
              visit(p + Eigen::Vector3i(offset(place, 0), offset(place, 1), offset(place, 2)));
          }
        }
      }
    }
  }
  return found;
}

/// Corners − edges + faces − voxels of the union of closed voxels.
long euler_characteristic(const VoxelGrid& grid) {
  long sum = 0;
  // A cell of the complex is even or odd along each axis of the doubled grid; it is there where a voxel has it.
  for (int z = 0; z <= 2 * grid.size.z(); ++z) {
    for (int y = 0; y <= 2 * grid.size.y(); ++y) {
      for (int x = 0; x <= 2 * grid.size.x(); ++x) {
        bool there = false;
        for (int corner = 0; corner < 8 && !there; ++corner) {
          const int i = x % 2 != 0 ? x / 2 : x / 2 - (corner & 1), j = y % 2 != 0 ? y / 2 : y / 2 - (corner >> 1 & 1),
                    k = z % 2 != 0 ? z / 2 : z / 2 - (corner >> 2 & 1);
          there = is_inside(grid, i, j, k);
        }
        if (there) sum += (x % 2 + y % 2 + z % 2) % 2 == 0 ? 1 : -1;
      }
    }
  }
  return sum;
}

}  // namespace

VoxelGrid thinned(VoxelGrid grid) {
  bool peeled = true;
  while (peeled) {
    peeled = false;
    for (int axis = 0; axis < 3; ++axis) {
      for (const int sign : {1, -1}) peeled = peel(grid, sign * Eigen::Vector3i::Unit(axis)) || peeled;
    }
  }
  return grid;
}

Topology topology_of(const VoxelGrid& grid) {
  Topology topology;
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      for (int i = 0; i < grid.size.x(); ++i) {
        if (!is_inside(grid, i, j, k)) continue;
        ++topology.voxels;
        topology.ends += neighbours(block_at(grid, i, j, k)) == 1 ? 1 : 0;
      }
    }
  }
  topology.pieces = pieces_of(grid, true, 3);
  topology.cavities = pieces_of(grid, false, 1) - 1;
  topology.loops =
      static_cast<std::size_t>(static_cast<long>(topology.pieces + topology.cavities) - euler_characteristic(grid));
  return topology;
}

}  // namespace tubetrack::bench
