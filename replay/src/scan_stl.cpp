#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "scan_bytes.hpp"
#include "scan_readers.hpp"

namespace tubetrack {

namespace {

constexpr std::size_t kStlHeader_bytes = 84;  // 80 of text and the number of faces
constexpr std::size_t kFace_bytes = 50;

RawSurface read_binary(std::string_view bytes) {
  constexpr bool swapped = std::endian::native == std::endian::big;
  const double count = load_number(bytes.data() + 80, NumberType::uint32, swapped);
  require_room("faces", count, kFace_bytes, static_cast<double>(bytes.size() - kStlHeader_bytes));
  const auto face_count = static_cast<std::size_t>(count);
  RawSurface surface;
  surface.points.reserve(3 * face_count);
  surface.faces.reserve(face_count);
  for (std::size_t i = 0; i < face_count; ++i) {
    // The face's normal comes first; it says what the order of the corners says, or is zero.
    const char* corner = bytes.data() + kStlHeader_bytes + i * kFace_bytes + 12;
    for (int k = 0; k < 3; ++k) {
      Eigen::Vector3d point;
      for (double& coordinate : point) {
        coordinate = load_number(corner, NumberType::float32, swapped);
        corner += 4;
      }
      surface.points.push_back(point);
    }
    const auto first = static_cast<std::uint32_t>(3 * i);
    surface.faces.push_back({first, first + 1, first + 2});
  }
  return surface;
}

RawSurface read_ascii(std::string_view bytes) {
  TextCursor text(bytes);
  RawSurface surface;
  std::string_view line;
  std::vector<long long> corners;
  bool open_facet = false;
  bool ended = false;
  while (text.next_line(line)) {
    const std::string_view keyword = next_word(line);
    if (keyword == "vertex") {
      corners.push_back(static_cast<long long>(surface.points.size()));
      Eigen::Vector3d point;
      for (double& coordinate : point) coordinate = take_number(line, "vertex", text.line());
      surface.points.push_back(point);
    } else if (keyword == "facet") {
      open_facet = true;
      corners.clear();
    } else if (keyword == "endfacet") {
      if (corners.size() < 3) {
        throw ScanRefusal{fmt::format("line {}: facet: got {} corners, takes 3; correct or export it again",
                                      text.line(), corners.size())};
      }
      add_polygon(surface, corners, "line", text.line());
      open_facet = false;
    } else if (keyword == "endsolid") {
      ended = true;
    }
  }
  if (open_facet || !ended) {
    throw ScanRefusal{
        fmt::format("line {}: ends without \"endsolid\", after {} faces; it was cut off: copy or export "
                    "it again",
                    text.line(), surface.faces.size())};
  }
  return surface;
}

}  // namespace

RawSurface read_stl(std::string_view bytes) {
  // Binary files may begin with "solid" too, so their size is asked first.
  const auto binary_size = [&] {
    const double count = load_number(bytes.data() + 80, NumberType::uint32, std::endian::native == std::endian::big);
    return kStlHeader_bytes + static_cast<std::size_t>(count) * kFace_bytes;
  };
  if (bytes.size() >= kStlHeader_bytes && bytes.size() == binary_size()) return read_binary(bytes);
  if (bytes.starts_with("solid") && bytes.find("facet") != std::string_view::npos) return read_ascii(bytes);
  // No text has a zero byte: a cut-off or padded binary file that begins with "solid".
  const bool text = bytes.substr(0, 1000).find('\0') == std::string_view::npos;
  if (bytes.starts_with("solid") && text) return read_ascii(bytes);
  if (bytes.size() < kStlHeader_bytes) {
    throw ScanRefusal{
        fmt::format("has {} bytes, takes at least {}, or text that begins with \"solid\"; it was cut off "
                    "or is no STL file",
                    bytes.size(), kStlHeader_bytes)};
  }
  return read_binary(bytes);
}

}  // namespace tubetrack
