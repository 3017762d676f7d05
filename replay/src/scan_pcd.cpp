#include <fmt/format.h>
#include <liblzf/lzf.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "scan_bytes.hpp"
#include "scan_readers.hpp"

namespace tubetrack {

namespace {

struct Field {
  std::string name;
  NumberType type = NumberType::float32;
  std::size_t count = 1;
  std::size_t offset = 0;  ///< in a point's record
};

struct PcdHeader {
  std::vector<Field> fields;
  std::size_t record_bytes = 0;
  long long width = 0;
  long long height = 1;
  long long points = -1;
  std::optional<Eigen::Vector3d> viewpoint;
  std::string data;  ///< ascii, binary or binary_compressed
};

constexpr bool kSwapped = std::endian::native == std::endian::big;  // PCD is little endian in practice

NumberType type_of(std::string_view letter, long long size) {
  using enum NumberType;
  if (letter == "F" && (size == 4 || size == 8)) return size == 4 ? float32 : float64;
  if (letter == "I" || letter == "U") {
    const bool is_signed = letter == "I";
    if (size == 1) return is_signed ? int8 : uint8;
    if (size == 2) return is_signed ? int16 : uint16;
    if (size == 4) return is_signed ? int32 : uint32;
    if (size == 8) return is_signed ? int64 : uint64;
  }
  throw ScanRefusal{
      fmt::format("TYPE and SIZE: got {} of {} bytes, takes F of 4 or 8, I or U of 1, 2, 4 or 8; correct "
                  "the header",
                  in_quotes(letter), size)};
}

/// The per-field lines of the header, before they are put together.
struct Columns {
  std::vector<std::string> names, types;
  std::vector<long long> sizes, counts;
};

void put_fields_together(PcdHeader& header, const Columns& columns) {
  const std::size_t n = columns.names.size();
  if (n == 0 || columns.sizes.size() != n || columns.types.size() != n ||
      (!columns.counts.empty() && columns.counts.size() != n)) {
    throw ScanRefusal{
        fmt::format("FIELDS, SIZE, TYPE and COUNT: got {}, {}, {} and {} entries, takes equally many; "
                    "correct the header",
                    n, columns.sizes.size(), columns.types.size(), columns.counts.size())};
  }
  for (std::size_t i = 0; i < n; ++i) {
    const long long count = columns.counts.empty() ? 1 : columns.counts[i];
    if (count < 1 || count > 100'000)
      throw ScanRefusal{fmt::format("COUNT: got {}, takes 1 to 100000; correct the header", count)};
    Field field{columns.names[i], type_of(columns.types[i], columns.sizes[i]), static_cast<std::size_t>(count),
                header.record_bytes};
    header.record_bytes += field.count * size_of(field.type);
    header.fields.push_back(std::move(field));
  }
}

void take_line(PcdHeader& header, Columns& columns, std::string_view keyword, std::string_view rest, int line) {
  const auto integers = [&](std::vector<long long>& to) {
    while (rest.find_first_not_of(" \t\r") != std::string_view::npos) to.push_back(take_integer(rest, keyword, line));
  };
  const auto words = [&](std::vector<std::string>& to) {
    for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) to.emplace_back(word);
  };
  if (keyword == "FIELDS" || keyword == "COLUMNS") return words(columns.names);
  if (keyword == "TYPE") return words(columns.types);
  if (keyword == "SIZE") return integers(columns.sizes);
  if (keyword == "COUNT") return integers(columns.counts);
  if (keyword == "WIDTH") header.width = take_integer(rest, keyword, line);
  if (keyword == "HEIGHT") header.height = take_integer(rest, keyword, line);
  if (keyword == "POINTS") header.points = take_integer(rest, keyword, line);
  if (keyword == "VIEWPOINT") {
    Eigen::Vector3d viewpoint;
    for (double& coordinate : viewpoint) coordinate = take_number(rest, keyword, line);
    header.viewpoint = viewpoint;
  }
}

PcdHeader read_pcd_header(TextCursor& text) {
  PcdHeader header;
  Columns columns;
  std::string_view line;
  while (header.data.empty() && text.next_content(line, '#')) {
    const std::string_view keyword = next_word(line);
    if (keyword == "DATA") {
      header.data = next_word(line);
      if (header.data.empty()) throw ScanRefusal{"DATA: got nothing, takes ascii, binary or binary_compressed"};
    } else {
      take_line(header, columns, keyword, line, text.line());
    }
  }
  if (header.data.empty()) throw ScanRefusal{"has no line \"DATA …\"; it was cut off in its header, or is no PCD file"};
  put_fields_together(header, columns);
  constexpr double kMost = 1e15;
  const double cells = static_cast<double>(header.width) * static_cast<double>(header.height);
  if (header.points < 0 && cells >= 0 && cells < kMost) header.points = header.width * header.height;
  if (header.width < 0 || header.height < 0 || cells > kMost || header.points != header.width * header.height) {
    throw ScanRefusal{fmt::format("POINTS: got {}, but WIDTH x HEIGHT is {} x {}; correct the header", header.points,
                                  header.width, header.height)};
  }
  return header;
}

/// Where x, y, z and, if all are there, the normal's components are; empty where there are no normals.
std::vector<const Field*> wanted_fields(const PcdHeader& header) {
  constexpr std::array<std::string_view, 6> names = {"x", "y", "z", "normal_x", "normal_y", "normal_z"};
  std::vector<const Field*> found;
  for (const std::string_view name : names) {
    const auto at = std::find_if(header.fields.begin(), header.fields.end(),
                                 [&](const Field& field) { return field.name == name; });
    if (at != header.fields.end()) {
      found.push_back(&*at);
    } else if (found.size() < 3) {
      throw ScanRefusal{fmt::format("FIELDS: {} is missing; takes x, y and z", in_quotes(name))};
    }
  }
  if (found.size() < 6) found.resize(3);
  return found;
}

void add_point(RawSurface& surface, const std::array<double, 6>& values, bool has_normal) {
  surface.points.emplace_back(values[0], values[1], values[2]);
  if (has_normal) surface.normals.push_back(Eigen::Vector3d(values[3], values[4], values[5]).cast<float>());
}

void read_ascii(TextCursor& text, const PcdHeader& header, RawSurface& surface) {
  const auto wanted = wanted_fields(header);
  double words_a_line = 0.0;
  for (const Field& field : header.fields) words_a_line += static_cast<double>(field.count);
  const auto available = static_cast<double>(text.rest().size()) + 1.0;
  require_room("points", static_cast<double>(header.points), 2.0 * words_a_line, available);
  for (long long i = 0; i < header.points; ++i) {
    std::string_view line;
    if (!text.next_content(line, '#')) {
      throw ScanRefusal{
          fmt::format("ends after {} of {} points; it was cut off: copy or export it again", i, header.points)};
    }
    std::array<double, 6> values{};
    for (const Field& field : header.fields) {
      const auto slot = static_cast<std::size_t>(std::find(wanted.begin(), wanted.end(), &field) - wanted.begin());
      const double value = take_number(line, field.name, text.line());
      if (slot < wanted.size()) values[slot] = value;
      for (std::size_t k = 1; k < field.count; ++k) take_number(line, field.name, text.line());
    }
    add_point(surface, values, wanted.size() == 6);
  }
}

/// `compressed`: first all values of the first field, then all of the second …; else point after point.
void read_records(std::string_view bytes, const PcdHeader& header, bool compressed, RawSurface& surface) {
  const auto wanted = wanted_fields(header);
  const auto count = static_cast<std::size_t>(header.points);
  surface.points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::array<double, 6> values{};
    for (std::size_t k = 0; k < wanted.size(); ++k) {
      const Field& field = *wanted[k];
      const std::size_t field_bytes = field.count * size_of(field.type);
      const std::size_t at =
          compressed ? field.offset * count + i * field_bytes : i * header.record_bytes + field.offset;
      values[k] = load_number(bytes.data() + at, field.type, kSwapped);
    }
    add_point(surface, values, wanted.size() == 6);
  }
}

std::string decompressed(std::string_view bytes, double expected_bytes) {
  if (bytes.size() < 8) throw ScanRefusal{"ends before its compressed points; it was cut off: copy or export it again"};
  const double packed = load_number(&bytes.front(), NumberType::uint32, kSwapped);
  const double unpacked = load_number(bytes.data() + 4, NumberType::uint32, kSwapped);
  require_room("compressed bytes", packed, 1.0, static_cast<double>(bytes.size() - 8));
  if (unpacked != expected_bytes) {
    throw ScanRefusal{
        fmt::format("compressed points: got {:.0f} bytes, the header's fields and points take {:.0f}; "
                    "export it again",
                    unpacked, expected_bytes)};
  }
  // LZF makes at most 264 bytes of 3, so a small file cannot ask for much.
  require_room("bytes of points, compressed", unpacked, 1.0, 100.0 * packed + 1000.0);
  std::string result(static_cast<std::size_t>(unpacked), '\0');
  const unsigned done =
      lzf_decompress(bytes.data() + 8, static_cast<unsigned>(packed), result.data(), static_cast<unsigned>(unpacked));
  if (done != result.size())
    throw ScanRefusal{"compressed points: damaged; copy it again, or export it as DATA binary"};
  return result;
}

}  // namespace

RawSurface read_pcd(std::string_view bytes) {
  TextCursor text(bytes);
  const PcdHeader header = read_pcd_header(text);
  const double total_bytes = static_cast<double>(header.points) * static_cast<double>(header.record_bytes);
  RawSurface surface;
  if (header.data == "ascii") {
    read_ascii(text, header, surface);
  } else if (header.data == "binary") {
    require_room("points", static_cast<double>(header.points), static_cast<double>(header.record_bytes),
                 static_cast<double>(text.rest().size()));
    read_records(text.rest(), header, false, surface);
  } else if (header.data == "binary_compressed") {
    read_records(decompressed(text.rest(), total_bytes), header, true, surface);
  } else {
    throw ScanRefusal{fmt::format("DATA: got {}, takes ascii, binary or binary_compressed", in_quotes(header.data))};
  }
  // Rows and columns mean a sensor's frame, and only then does the viewpoint, which PCL always writes, say anything.
  if (header.height > 1) surface.viewpoint = header.viewpoint;
  return surface;
}

}  // namespace tubetrack
