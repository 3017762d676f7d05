#include <fmt/format.h>

#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "image_file.hpp"
#include "scan_bytes.hpp"
#include "scan_readers.hpp"
#include "tubetrack/replay/height_map_file.hpp"

namespace tubetrack {

namespace {

/// The flag's value, where there is one, with a note where the file says another.
void overrule(const char* flag, std::optional<double> value, const std::filesystem::path& json, double& target,
              std::vector<std::string>& notes) {
  if (!value) return;
  if (target > 0.0 && target != *value)
    notes.push_back(fmt::format("{} {:g}: in place of {:g} in {}", flag, *value, target, json.string()));
  target = *value;
}

/// What the JSON beside the image says, or the flags, which win.
HeightMapFile described(const std::filesystem::path& path, const ScanOptions& options,
                        std::vector<std::string>& notes) {
  HeightMapFile file;
  std::error_code ignored;
  const std::filesystem::path json = height_map_json_path(path);
  if (std::filesystem::exists(json, ignored)) {
    if (options.cell_size_m && options.height_scale_m) {
      notes.push_back(fmt::format("--cell-size, --height-scale: {} and the pose in it are not read", json.string()));
    } else {
      auto read = read_height_map_json(json);
      if (!read) throw ScanRefusal{read.error().message, read.error().kind};
      file = std::move(*read);
    }
  }
  overrule("--cell-size", options.cell_size_m, json, file.cell_size_m, notes);
  overrule("--height-scale", options.height_scale_m, json, file.height_scale_m, notes);
  if (file.cell_size_m > 0.0 && file.height_scale_m > 0.0) return file;
  throw ScanRefusal{fmt::format("a height map takes {}; give both, in metres: --cell-size 0.0005 --height-scale "
                                "0.00001",
                                options.cell_size_m ? "--height-scale (metres per count)"
                                                    : "--cell-size (edge of a pixel) and --height-scale"),
                    Error::Kind::usage};
}

}  // namespace

Scan read_height_image(const std::filesystem::path& path, const ScanOptions& options) {
  std::vector<std::string> notes;
  HeightMapFile file = described(path, options, notes);
  const auto image = read_depth_image(path);
  if (!image) {
    std::string text = image.error().message;
    const std::string prefix = path.string() + ": ";  // read_scan puts it there
    if (text.starts_with(prefix)) text.erase(0, prefix.size());
    throw ScanRefusal{text};
  }
  file.width = image->width;
  file.height = image->height;
  file.counts.reserve(static_cast<std::size_t>(file.width) * static_cast<std::size_t>(file.height));
  for (int v = 0; v < file.height; ++v) {
    const auto* row = image->pixels + static_cast<std::size_t>(v) * (image->stride_bytes / sizeof(std::uint16_t));
    file.counts.insert(file.counts.end(), row, row + file.width);
  }
  Scan scan = scan_of(file);
  scan.notes = std::move(notes);
  return scan;
}

}  // namespace tubetrack
