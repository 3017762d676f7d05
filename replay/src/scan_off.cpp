#include <fmt/format.h>

#include "scan_bytes.hpp"
#include "scan_readers.hpp"

namespace tubetrack {

namespace {

struct Counts {
  long long points = 0;
  long long faces = 0;
};

/// The keyword (OFF, COFF, NOFF, CNOFF …) and the counts, which may stand on its line or on the next.
Counts read_counts(TextCursor& text) {
  std::string_view line;
  if (!text.next_content(line, '#')) throw ScanRefusal{"has no line of content; copy or export it again"};
  std::string_view rest = line;
  std::string_view keyword = next_word(rest);
  if (keyword.ends_with("OFF")) {
    if (keyword.starts_with("4") || keyword.find('n') != std::string_view::npos) {
      throw ScanRefusal{fmt::format("line {}: {}: points of other than 3 coordinates; export it as plain OFF",
                                    text.line(), in_quotes(keyword))};
    }
    if (next_word(rest) == "BINARY")
      throw ScanRefusal{"is a binary OFF, takes a text OFF; export it as text or as PLY"};
    rest = line.substr(line.find("OFF") + 3);
    if (rest.find_first_not_of(" \t") == std::string_view::npos && !text.next_content(rest, '#'))
      throw ScanRefusal{"ends before the counts of points and faces; copy or export it again"};
  } else if (integer_in(keyword)) {
    rest = line;  // some programs leave the keyword out
  } else {
    throw ScanRefusal{fmt::format("line {}: got {}, takes \"OFF\"; this is no OFF file: check its name", text.line(),
                                  in_quotes(keyword))};
  }
  Counts counts;
  counts.points = take_integer(rest, "count of points", text.line());
  counts.faces = take_integer(rest, "count of faces", text.line());
  constexpr double kShortestPoint_bytes = 6.0;  // "0 0 0\n"
  const auto available = static_cast<double>(text.rest().size()) + 1.0;
  require_room("points", static_cast<double>(counts.points), kShortestPoint_bytes, available);
  require_room("faces", static_cast<double>(counts.faces), 2.0, available);
  return counts;
}

std::string_view content_line(TextCursor& text, std::string_view what, long long index, long long count) {
  std::string_view line;
  if (text.next_content(line, '#')) return line;
  throw ScanRefusal{fmt::format("line {}: ends after {} of {} {}; it was cut off: copy or export it again", text.line(),
                                index, count, what)};
}

}  // namespace

RawSurface read_off(std::string_view bytes) {
  TextCursor text(bytes);
  const Counts counts = read_counts(text);
  RawSurface surface;
  surface.points.reserve(static_cast<std::size_t>(counts.points));
  surface.faces.reserve(static_cast<std::size_t>(counts.faces));
  for (long long i = 0; i < counts.points; ++i) {
    std::string_view line = content_line(text, "points", i, counts.points);
    Eigen::Vector3d point;
    for (double& coordinate : point) coordinate = take_number(line, "point", text.line());
    surface.points.push_back(point);  // what follows is a normal or a colour
  }
  std::vector<long long> corners;
  for (long long i = 0; i < counts.faces; ++i) {
    std::string_view line = content_line(text, "faces", i, counts.faces);
    const long long corner_count = take_integer(line, "number of corners", text.line());
    require_room("corners of a face", static_cast<double>(corner_count), 1.0, static_cast<double>(line.size()));
    corners.clear();
    for (long long k = 0; k < corner_count; ++k) corners.push_back(take_integer(line, "corner", text.line()));
    add_polygon(surface, corners, "line", text.line());
  }
  return surface;
}

}  // namespace tubetrack
