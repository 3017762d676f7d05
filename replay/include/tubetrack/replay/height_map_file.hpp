#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tubetrack/heightmap/plane_map.hpp"
#include "tubetrack/replay/scan_file.hpp"

namespace tubetrack {

/// A height map as its files have it: a 16-bit image, and beside it a JSON file of the same name with what the image
/// does not say (docs/scans.md).
struct HeightMapFile {
  int width = 0;
  int height = 0;
  std::vector<std::uint16_t> counts;  ///< row-major; 0: no height
  double cell_size_m = 0.0;
  double height_scale_m = 0.0;  ///< metres per count
  /// From the map's frame, in which a cell's point is (col · cell, row · cell, −count · scale), to that which
  /// `frame_id` names.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::string frame_id = "camera";
};

/// Heights in steps of 10 µm.
HeightMapFile height_map_file_of(const PlaneMap& map, const std::string& frame_id);

/// The scan that reading the files back gives.
Scan scan_of(const HeightMapFile& file);

/// Writes `path` (.png) and the JSON beside it; the error names the file and the reason.
Expected<void> write_height_map(const HeightMapFile& file, const std::filesystem::path& path);

/// Where the JSON beside a height map's image is.
std::filesystem::path height_map_json_path(const std::filesystem::path& image);

/// The JSON beside an image, without the counts; usage errors name the key that is wrong.
Expected<HeightMapFile> read_height_map_json(const std::filesystem::path& path);

}  // namespace tubetrack
