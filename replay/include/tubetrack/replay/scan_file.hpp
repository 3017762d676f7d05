#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

enum class ScanKind { mesh, cloud, voxels, height_map };

/// What a length of 1 in the file is. With `voxel` the edge of a voxel counts as 1 mm, whatever the header says, so
/// that a result of 0.0049 m reads 4.9 voxels.
enum class ScanUnit { millimetre, metre, voxel };

/// What a file does not say itself. Every field is a flag of `tubetrack scan`.
struct ScanOptions {
  std::optional<ScanUnit> unit;          ///< --unit; else the header's, and millimetres where there is none
  std::optional<double> cell_size_m;     ///< --cell-size: edge of a height map's cell, or of a voxel
  std::optional<double> height_scale_m;  ///< --height-scale: metres per count of a height map; wins over its JSON
  std::optional<double> label;           ///< --label: the voxels of this value are the body
  std::optional<double> threshold;       ///< --threshold: the voxels of this value and above are the body
  std::size_t memory_limit_bytes = 0;    ///< files and volumes above this are refused; 0: half the machine's memory
};

/// The body's voxels: voxel (i, j, k) has its centre at origin_m + axes_m · (i, j, k).
struct VoxelGrid {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes_m = Eigen::Matrix3d::Identity();  ///< a column is the way from a voxel to the next
  std::vector<std::uint8_t> inside;                      ///< 1: in the body; i runs fastest

  std::size_t at(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(size.y()) + static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(size.x()) +
           static_cast<std::size_t>(i);
  }
  bool contains(int i, int j, int k) const {
    return i >= 0 && j >= 0 && k >= 0 && i < size.x() && j < size.y() && k < size.z();
  }
};

/// Heights over a plane, row-major. A cell's point is (column · cell, row · cell, −height): x right, y down, z away
/// from the viewer, as in a camera frame.
struct HeightGrid {
  int width = 0;
  int height = 0;
  double cell_size_m = 0.0;
  std::vector<float> height_m;  ///< NaN: none (0 in the file)
};

/// A static scan in metres, put right: no point twice, no degenerate face, consistently oriented. Frame: the file's
/// own, moved by −origin_m.
struct Scan {
  ScanKind kind = ScanKind::mesh;
  std::vector<Eigen::Vector3d> points_m;            ///< mesh, cloud
  std::vector<Eigen::Vector3f> normals;             ///< cloud: unit, outward (away from the tube's axis), one a point
  std::vector<std::array<std::uint32_t, 3>> faces;  ///< mesh: counter-clockwise seen from outside
  VoxelGrid voxels;
  HeightGrid heights;
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  ///< not zero where coordinates are too large for `float`
  /// A height map's, from the JSON beside it: where results belong.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  double metres_per_unit = 0.001;
  double grid_step_m = 0.0;        ///< default of the paper's section 2.1, see default_grid_step_m
  std::vector<std::string> notes;  ///< for the summary: what was assumed, dropped or put right
};

/// Reads any format of docs/scans.md, by the file name's extension. Error::usage where the command has to be typed
/// differently (no such file, no such format, a flag missing); Error::failed where the file is no good.
Expected<Scan> read_scan(const std::filesystem::path& path, const ScanOptions& options);

/// Paper, section 2.1: the median of the faces' longest edges (mesh); the grid's own resolution (voxels, height map).
/// For clouds, which the paper does not have, the median distance to the nearest point. Where faces are slivers, as CAD
/// programs make them, their longest edge says nothing of the detail: the median of their shortest edges. 0 when there
/// is nothing to measure.
double default_grid_step_m(const Scan& scan);

}  // namespace tubetrack
