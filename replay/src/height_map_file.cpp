#include "tubetrack/replay/height_map_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "image_file.hpp"
#include "tubetrack/sensors/json_problem.hpp"

namespace tubetrack {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kScale_m = 1e-5;

Expected<void> write_json(const HeightMapFile& file, const std::filesystem::path& path) {
  const Eigen::Quaterniond turn(file.pose.linear());
  const Eigen::Vector3d& at = file.pose.translation();
  const Json json{{"cell_size_m", file.cell_size_m},
                  {"height_scale_m", file.height_scale_m},
                  {"frame_id", file.frame_id},
                  {"position_m", {at.x(), at.y(), at.z()}},
                  {"quaternion_xyzw", {turn.x(), turn.y(), turn.z(), turn.w()}}};
  std::ofstream out(path);
  out << json.dump(2) << "\n" << std::flush;
  if (out) return {};
  return tl::make_unexpected(
      Error::failed(fmt::format("{}: cannot be written; check the free space and the rights", path.string())));
}

double above_0(const Json& json, const char* key) {
  const double value = json.at(key).get<double>();
  if (!(value > 0.0) || !std::isfinite(value))
    throw std::invalid_argument(fmt::format("{}: got {:g}, takes metres above 0", key, value));
  return value;
}

}  // namespace

HeightMapFile height_map_file_of(const PlaneMap& map, const std::string& frame_id) {
  HeightMapFile file;
  file.width = map.width;
  file.height = map.height;
  file.cell_size_m = map.cell_m;
  file.height_scale_m = kScale_m;
  file.frame_id = frame_id;
  file.counts.reserve(map.height_m.size());
  constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
  for (const float height_m : map.height_m) {
    const double count = 1.0 + std::round((height_m - kLowest_m) / kScale_m);
    file.counts.push_back(std::isnan(height_m) ? std::uint16_t{0}
                                               : static_cast<std::uint16_t>(std::clamp(count, 1.0, kMost)));
  }
  const Eigen::Vector3d first_m((map.first_col + 0.5) * map.cell_m, (map.first_row + 0.5) * map.cell_m,
                                kScale_m - kLowest_m);
  file.pose = map.world_from_plane * Eigen::Translation3d(first_m);
  return file;
}

Scan scan_of(const HeightMapFile& file) {
  Scan scan;
  scan.kind = ScanKind::height_map;
  scan.heights = {file.width, file.height, file.cell_size_m, {}};
  scan.heights.height_m.reserve(file.counts.size());
  for (const std::uint16_t count : file.counts) {
    scan.heights.height_m.push_back(count == 0 ? std::numeric_limits<float>::quiet_NaN()
                                               : static_cast<float>(count * file.height_scale_m));
  }
  scan.metres_per_unit = file.height_scale_m;
  scan.grid_step_m = default_grid_step_m(scan);
  scan.pose = file.pose;
  return scan;
}

Expected<void> write_height_map(const HeightMapFile& file, const std::filesystem::path& path) {
  DepthFrame image;
  image.pixels = file.counts.data();
  image.width = file.width;
  image.height = file.height;
  image.stride_bytes = static_cast<std::size_t>(file.width) * sizeof(std::uint16_t);
  if (auto written = write_depth_png(path, image); !written) return written;
  return write_json(file, height_map_json_path(path));
}

std::filesystem::path height_map_json_path(const std::filesystem::path& image) {
  return std::filesystem::path(image).replace_extension(".json");
}

Expected<HeightMapFile> read_height_map_json(const std::filesystem::path& path) {
  try {
    std::ifstream in(path);
    const Json json = Json::parse(in);
    HeightMapFile file;
    file.cell_size_m = above_0(json, "cell_size_m");
    file.height_scale_m = above_0(json, "height_scale_m");
    file.frame_id = json.value("frame_id", file.frame_id);
    if (json.contains("position_m")) {
      const auto p = json.at("position_m").get<std::array<double, 3>>();
      file.pose.translation() = Eigen::Vector3d(p[0], p[1], p[2]);
    }
    if (json.contains("quaternion_xyzw")) {
      const auto q = json.at("quaternion_xyzw").get<std::array<double, 4>>();
      const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
      if (!(turn.norm() > 1e-9)) throw std::invalid_argument("quaternion_xyzw: is zero, takes a turn");
      file.pose.linear() = turn.normalized().toRotationMatrix();
    }
    return file;
  } catch (const std::exception& problem) {
    return tl::make_unexpected(Error::usage(
        fmt::format("{}: {}; give --cell-size and --height-scale instead", path.string(), json_problem(problem))));
  }
}

}  // namespace tubetrack
