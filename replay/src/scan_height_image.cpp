#include <fmt/format.h>

#include <limits>

#include "image_file.hpp"
#include "scan_bytes.hpp"
#include "scan_readers.hpp"

namespace tubetrack {

HeightGrid read_height_image(const std::filesystem::path& path, const ScanOptions& options) {
  if (!options.cell_size_m || !options.height_scale_m) {
    throw ScanRefusal{fmt::format("a height map takes {}; give both, in metres: --cell-size 0.0005 --height-scale "
                                  "0.00001",
                                  options.cell_size_m ? "--height-scale (metres per count)"
                                                      : "--cell-size (edge of a pixel) and --height-scale"),
                      Error::Kind::usage};
  }
  const auto image = read_depth_image(path);
  if (!image) {
    std::string text = image.error().message;
    const std::string prefix = path.string() + ": ";  // read_scan puts it there
    if (text.starts_with(prefix)) text.erase(0, prefix.size());
    throw ScanRefusal{text};
  }
  HeightGrid grid{image->width, image->height, *options.cell_size_m, {}};
  grid.height_m.reserve(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height));
  for (int v = 0; v < grid.height; ++v) {
    const auto* row = image->pixels + static_cast<std::size_t>(v) * (image->stride_bytes / sizeof(std::uint16_t));
    for (int u = 0; u < grid.width; ++u) {
      grid.height_m.push_back(row[u] == 0 ? std::numeric_limits<float>::quiet_NaN()
                                          : static_cast<float>(row[u] * *options.height_scale_m));
    }
  }
  return grid;
}

}  // namespace tubetrack
