#include <fmt/format.h>

#include "scan_bytes.hpp"
#include "scan_readers.hpp"

namespace tubetrack {

namespace {

Eigen::Vector3d take_point(std::string_view line, std::string_view field, int number) {
  Eigen::Vector3d point;
  for (double& coordinate : point) coordinate = take_number(line, field, number);
  return point;
}

/// "7", "7/1", "7//3", "7/1/3", "-1": the point's index from 0. Negative ones count back from the last point so far.
long long corner_of(std::string_view word, std::size_t point_count, int line) {
  const auto index = integer_in(word.substr(0, word.find('/')));
  if (!index || *index == 0) {
    throw ScanRefusal{fmt::format("line {}: corner: got {}, takes a point's number, from 1; correct or export it again",
                                  line, in_quotes(word))};
  }
  return *index > 0 ? *index - 1 : static_cast<long long>(point_count) + *index;
}

/// A face's corners are [first_corner, that of the next face).
struct ObjFace {
  std::size_t first_corner = 0;
  int line = 0;
};

}  // namespace

RawSurface read_obj(std::string_view bytes) {
  TextCursor text(bytes);
  RawSurface surface;
  std::vector<Eigen::Vector3f> normals;
  std::vector<long long> corners;
  std::vector<ObjFace> faces;
  std::string_view line;
  while (text.next_content(line, '#')) {
    const std::string_view keyword = next_word(line);
    if (keyword == "v") {
      surface.points.push_back(take_point(line, "v", text.line()));
    } else if (keyword == "vn") {
      normals.push_back(take_point(line, "vn", text.line()).cast<float>());
    } else if (keyword == "f") {
      faces.push_back({corners.size(), text.line()});
      for (std::string_view word = next_word(line); !word.empty(); word = next_word(line))
        corners.push_back(corner_of(word, surface.points.size(), text.line()));
    }
  }
  if (surface.points.empty()) throw ScanRefusal{"has no line \"v x y z\"; this is no OBJ file, or it has no points"};
  // A face may come before its points.
  const std::span<const long long> all(corners);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const std::size_t first = faces[i].first_corner;
    const std::size_t end = i + 1 < faces.size() ? faces[i + 1].first_corner : corners.size();
    add_polygon(surface, all.subspan(first, end - first), "line", faces[i].line);
  }
  if (surface.faces.empty() && normals.size() == surface.points.size()) surface.normals = std::move(normals);
  return surface;
}

}  // namespace tubetrack
