#include <fmt/format.h>

#include <system_error>
#include <vector>

#include "image_file.hpp"
#include "scan_bytes.hpp"
#include "scan_readers.hpp"
#include "tubetrack/replay/height_map_file.hpp"

namespace tubetrack {

namespace {

/// What the JSON beside the image says, or the flags, which win.
HeightMapFile described(const std::filesystem::path& path, const ScanOptions& options) {
  HeightMapFile file;
  std::error_code ignored;
  const std::filesystem::path json = height_map_json_path(path);
  if (!(options.cell_size_m && options.height_scale_m) && std::filesystem::exists(json, ignored)) {
    auto read = read_height_map_json(json);
    if (!read) throw ScanRefusal{read.error().message, read.error().kind};
    file = std::move(*read);
  }
  file.cell_size_m = options.cell_size_m.value_or(file.cell_size_m);
  file.height_scale_m = options.height_scale_m.value_or(file.height_scale_m);
  if (file.cell_size_m > 0.0 && file.height_scale_m > 0.0) return file;
  throw ScanRefusal{fmt::format("a height map takes {}; give both, in metres: --cell-size 0.0005 --height-scale "
                                "0.00001",
                                options.cell_size_m ? "--height-scale (metres per count)"
                                                    : "--cell-size (edge of a pixel) and --height-scale"),
                    Error::Kind::usage};
}

}  // namespace

Scan read_height_image(const std::filesystem::path& path, const ScanOptions& options) {
  HeightMapFile file = described(path, options);
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
  return scan_of(file);
}

}  // namespace tubetrack
