#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tubetrack/replay/scan_file.hpp"

namespace tubetrack {

inline constexpr double kMetresPerMillimetre = 0.001;

/// Points, and faces where there are any, as a file has them: its unit, its order, its mistakes.
struct RawSurface {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3f> normals;  ///< one a point, or none
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::optional<Eigen::Vector3d> viewpoint;  ///< of the sensor, where the file is one sensor's frame
  std::vector<std::string> notes;
};

/// A volume as its header describes it, the voxels already told apart into body and rest.
struct RawVolume {
  VoxelGrid grid;                         ///< origin and axes in the header's unit, in voxels where it has none
  std::optional<double> metres_per_unit;  ///< where the header gives a spacing
  std::vector<std::string> notes;
};

// All of these throw ScanRefusal, and nothing else of their own. Faces with more than three corners are cut into a fan.
RawSurface read_off(std::string_view bytes);
RawSurface read_obj(std::string_view bytes);
RawSurface read_ply(std::string_view bytes);
RawSurface read_stl(std::string_view bytes);
RawSurface read_xyz(std::string_view bytes);
RawSurface read_pcd(std::string_view bytes);
RawVolume read_vol(const std::filesystem::path& path, const ScanOptions& options);
RawVolume read_mhd(const std::filesystem::path& path, const ScanOptions& options);
RawVolume read_nifti(const std::filesystem::path& path, const ScanOptions& options);
Scan read_height_image(const std::filesystem::path& path, const ScanOptions& options);

/// Adds a polygon's triangles. Throws ScanRefusal when a corner is none of the surface's points; `what` and `number`
/// are for the message ("line 12"). Fewer than three corners add nothing.
void add_polygon(RawSurface& surface, std::span<const long long> corners, std::string_view what, long long number);

}  // namespace tubetrack
