#include <fmt/format.h>

#include "scan_volume.hpp"

namespace tubetrack {

namespace {

struct VolHeader {
  std::array<long long, 3> size{};
  long long version = 2;
  std::uint64_t data_begin = 0;
};

/// "Key: value" lines up to a line with a single dot. DGtal's header has a dozen of them.
VolHeader read_vol_header(const std::filesystem::path& path) {
  constexpr int kMaxLines = 200;
  const std::string start = read_header_text(path);
  TextCursor text(start);
  std::string_view line;
  VolHeader header;
  while (text.next_line(line) && text.line() <= kMaxLines) {
    if (line == ".") {
      header.data_begin = start.size() - text.rest().size();
      return header;
    }
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) break;
    const std::string_view key = line.substr(0, colon);
    std::string_view value = line.substr(colon + 1);
    constexpr std::array<std::string_view, 3> axes = {"X", "Y", "Z"};
    for (std::size_t k = 0; k < 3; ++k) {
      if (key == axes[k]) header.size[k] = take_integer(value, key, text.line());
    }
    if (key == "Version") header.version = take_integer(value, key, text.line());
    if (key != "Voxel-Size") continue;
    const long long bytes = take_integer(value, key, text.line());
    if (bytes != 1) {
      throw ScanRefusal{fmt::format(
          "line {}: Voxel-Size: got {} bytes a voxel, takes 1; export it with one byte a voxel", text.line(), bytes)};
    }
  }
  throw ScanRefusal{
      fmt::format("line {}: the header takes lines \"Key: value\" and ends with a line \".\"; it was cut "
                  "off, or is no VOL file",
                  text.line())};
}

}  // namespace

RawVolume read_vol(const std::filesystem::path& path, const ScanOptions& options) {
  const VolHeader header = read_vol_header(path);
  if (header.version != 1 && header.version != 2 && header.version != 3)
    throw ScanRefusal{fmt::format("Version: got {}, takes 1, 2 or 3; export it again", header.version)};
  const bool compressed = header.version == 3;
  const double data_bytes =
      compressed ? -1.0 : static_cast<double>(std::filesystem::file_size(path) - header.data_begin);
  require_volume_fits(header.size, {}, data_bytes, options);
  RawVolume volume;
  ByteStream stream(path, header.data_begin, compressed);
  read_voxels(stream, header.size, {}, options, volume);
  return volume;
}

}  // namespace tubetrack
