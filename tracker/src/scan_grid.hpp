#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tubetrack/heightmap/surfel.hpp"

namespace tubetrack {

/// Surfels begin … end − 1 of a grid, all in the cube of 4³ cells around center_m.
struct SurfelBucket {
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  std::uint64_t cells = 0;  ///< a bit for each cell that has a surfel, x lowest, in their order
  std::uint32_t begin = 0;
  std::uint32_t end = 0;
};

/// How surfels that were taken together spread around their mean, in m²: xx, xy, xz, yy, yz, zz.
using SurfelSpread = std::array<float, 6>;

/// What a cell's surfels are taken together as: their means by weight, and how they spread.
struct CellSurfel {
  Eigen::Vector3f position_m = Eigen::Vector3f::Zero();
  Eigen::Vector3f inward_normal = Eigen::Vector3f::UnitZ();
  float weight = 0.0F;
  SurfelSpread spread{};
};

/// One surfel for each cell of a grid, in buckets, so that those near a line are found without looking at all.
struct SurfelGrid {
  double cell_m = 0.0;
  std::array<std::int32_t, 3> first_bucket{};  ///< along each axis, x first
  std::array<std::int32_t, 3> bits{};          ///< of a bucket's place from there
  std::vector<std::uint64_t> keys;             ///< the buckets' places, x lowest; ascending
  std::vector<CellSurfel> surfels;             ///< bucket by bucket
  std::vector<SurfelBucket> buckets;

  /// From a bucket's centre to its corners.
  double bucket_radius_m() const;
  /// Numbers of the buckets whose centres are in the box, and of some others, ascending.
  void buckets_in(const Eigen::AlignedBox3d& box, std::vector<std::uint32_t>& numbers) const;
};

/// One surfel for each cell: position and normal are means by weight. What a scan has more of than a vote or a fit
/// needs is taken together, so that the time depends on the surface alone and a normal is as smooth as the radii that
/// are looked for allow. Opposite walls of a thin plate in one cell cancel out. `left_out`: one flag a surfel, or
/// empty.
SurfelGrid merged_by_cell(std::span<const ScanSurfel> surfels, std::span<const char> left_out, double cell_m);

/// The same of a finer grid's.
SurfelGrid merged_by_cell(std::span<const CellSurfel> surfels, double cell_m);

/// Sets the flags of those surfels whose cell's surfel is flagged in the grid. What each was made of is found again by
/// where it is: to remember it took 40 MB of ten million.
void flag_members(const SurfelGrid& grid, std::span<const char> flags, std::span<const ScanSurfel> surfels,
                  std::vector<char>& members);
void flag_members(const SurfelGrid& grid, std::span<const char> flags, std::span<const CellSurfel> surfels,
                  std::vector<char>& members);

}  // namespace tubetrack
