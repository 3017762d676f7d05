#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "scan_bytes.hpp"
#include "scan_readers.hpp"

namespace tubetrack {

namespace {

struct Property {
  std::string name;
  NumberType type = NumberType::float32;
  bool is_list = false;
  NumberType count_type = NumberType::uint8;
};

struct Element {
  std::string name;
  long long count = 0;
  std::vector<Property> properties;
};

enum class Encoding { ascii, little_endian, big_endian };

struct PlyHeader {
  Encoding encoding = Encoding::ascii;
  std::vector<Element> elements;
};

NumberType type_named(std::string_view name, int line) {
  using enum NumberType;
  constexpr std::array<std::pair<std::string_view, NumberType>, 16> names = {{{"char", int8},
                                                                              {"int8", int8},
                                                                              {"uchar", uint8},
                                                                              {"uint8", uint8},
                                                                              {"short", int16},
                                                                              {"int16", int16},
                                                                              {"ushort", uint16},
                                                                              {"uint16", uint16},
                                                                              {"int", int32},
                                                                              {"int32", int32},
                                                                              {"uint", uint32},
                                                                              {"uint32", uint32},
                                                                              {"float", float32},
                                                                              {"float32", float32},
                                                                              {"double", float64},
                                                                              {"float64", float64}}};
  for (const auto& [known, type] : names) {
    if (known == name) return type;
  }
  throw ScanRefusal{
      fmt::format("line {}: property type: got {}, takes char, uchar, short, ushort, int, uint, float or "
                  "double; correct the header",
                  line, in_quotes(name))};
}

Encoding encoding_named(std::string_view name, int line) {
  if (name == "ascii") return Encoding::ascii;
  if (name == "binary_little_endian") return Encoding::little_endian;
  if (name == "binary_big_endian") return Encoding::big_endian;
  throw ScanRefusal{
      fmt::format("line {}: format: got {}, takes ascii, binary_little_endian or binary_big_endian; "
                  "correct the header",
                  line, in_quotes(name))};
}

Property property_of(std::string_view line, int number) {
  Property property;
  std::string_view word = next_word(line);
  if (word == "list") {
    property.is_list = true;
    property.count_type = type_named(next_word(line), number);
    word = next_word(line);
  }
  property.type = type_named(word, number);
  property.name = next_word(line);
  return property;
}

/// Leaves `text` at the first line or byte of data.
PlyHeader read_ply_header(TextCursor& text) {
  std::string_view line;
  if (!text.next_line(line) || next_word(line) != "ply")
    throw ScanRefusal{"line 1: takes \"ply\"; this is no PLY file: check its name"};
  PlyHeader header;
  bool has_format = false;
  while (text.next_line(line)) {
    const std::string_view keyword = next_word(line);
    if (keyword == "format") {
      header.encoding = encoding_named(next_word(line), text.line());
      has_format = true;
    } else if (keyword == "element") {
      Element element{std::string(next_word(line)), 0, {}};
      element.count = take_integer(line, "element count", text.line());
      header.elements.push_back(std::move(element));
    } else if (keyword == "property") {
      if (header.elements.empty())
        throw ScanRefusal{fmt::format("line {}: a property before any element; correct the header", text.line())};
      header.elements.back().properties.push_back(property_of(line, text.line()));
    } else if (keyword == "end_header") {
      if (!has_format) throw ScanRefusal{"format: is missing in the header; add e.g. \"format ascii 1.0\""};
      return header;
    }
  }
  throw ScanRefusal{
      fmt::format("ends in its header (no \"end_header\" in {} lines); it was cut off: copy or export it "
                  "again",
                  text.line())};
}

/// Reads one number after the other, from text or bytes.
class Numbers {
 public:
  Numbers(const TextCursor& text, Encoding encoding) : text_(text), bytes_(text.rest()), encoding_(encoding) {}

  void begin(const Element& element, long long index) {
    element_ = &element;
    index_ = index;
    if (encoding_ != Encoding::ascii) return;
    do {
      if (!text_.next_line(line_)) cut_off();
    } while (line_.find_first_not_of(" \t\r") == std::string_view::npos);
  }
  double next(NumberType type, std::string_view name) {
    if (encoding_ == Encoding::ascii) return take_number(line_, name, text_.line());
    const std::size_t size = size_of(type);
    if (bytes_.size() < size) cut_off();
    const bool little = encoding_ == Encoding::little_endian;
    const double value = load_number(&bytes_.front(), type, little != (std::endian::native == std::endian::little));
    bytes_.remove_prefix(size);
    return value;
  }
  double bytes_left() const { return static_cast<double>(encoding_ == Encoding::ascii ? line_.size() : bytes_.size()); }
  double data_left() const {
    return static_cast<double>(encoding_ == Encoding::ascii ? text_.rest().size() + 1 : bytes_.size());
  }

 private:
  [[noreturn]] void cut_off() const {
    throw ScanRefusal{fmt::format("ends after {} of {} of element {}; it was cut off: copy or export it again", index_,
                                  element_->count, in_quotes(element_->name))};
  }

  TextCursor text_;
  std::string_view bytes_;
  std::string_view line_;
  Encoding encoding_;
  const Element* element_ = nullptr;
  long long index_ = 0;
};

void check_room(const Element& element, const Numbers& numbers, Encoding encoding) {
  double least_bytes = encoding == Encoding::ascii ? 1.0 : 0.0;
  for (const Property& property : element.properties) {
    const NumberType type = property.is_list ? property.count_type : property.type;
    least_bytes += encoding == Encoding::ascii ? 1.0 : static_cast<double>(size_of(type));
  }
  if (least_bytes == 0.0 && element.count != 0)
    throw ScanRefusal{fmt::format("element {}: has no properties; correct the header", in_quotes(element.name))};
  require_room(fmt::format("of element {}", in_quotes(element.name)), static_cast<double>(element.count), least_bytes,
               numbers.data_left());
}

/// A list's numbers go to `list`. Returns a single number.
double take_property(Numbers& numbers, const Property& property, std::vector<long long>* list) {
  if (!property.is_list) return numbers.next(property.type, property.name);
  const double count = numbers.next(property.count_type, property.name);
  require_room(fmt::format("numbers in {}", in_quotes(property.name)), count, 1.0, numbers.bytes_left());
  for (double i = 0; i < count; ++i) {
    const double value = numbers.next(property.type, property.name);
    // Not a whole number in range: any index that add_polygon refuses.
    if (list != nullptr) list->push_back(std::abs(value) < 1e15 ? static_cast<long long>(value) : -1);
  }
  return 0.0;
}

void read_vertices(const Element& element, Numbers& numbers, RawSurface& surface) {
  constexpr std::array<std::string_view, 6> names = {"x", "y", "z", "nx", "ny", "nz"};
  std::vector<std::size_t> slots;  // where each property goes; names.size(): nowhere
  for (const Property& property : element.properties) {
    const auto found = property.is_list ? names.end() : std::find(names.begin(), names.end(), property.name);
    slots.push_back(static_cast<std::size_t>(found - names.begin()));
  }
  const auto has = [&](std::size_t slot) { return std::count(slots.begin(), slots.end(), slot) == 1; };
  for (std::size_t k = 0; k < 3; ++k) {
    if (!has(k))
      throw ScanRefusal{fmt::format("element \"vertex\": takes one property {}; correct the header", names[k])};
  }
  const bool has_normals = has(3) && has(4) && has(5);
  surface.points.reserve(static_cast<std::size_t>(element.count));
  if (has_normals) surface.normals.reserve(static_cast<std::size_t>(element.count));
  for (long long i = 0; i < element.count; ++i) {
    numbers.begin(element, i);
    std::array<double, 7> values{};
    for (std::size_t k = 0; k < slots.size(); ++k)
      values[slots[k]] = take_property(numbers, element.properties[k], nullptr);
    surface.points.emplace_back(values[0], values[1], values[2]);
    if (has_normals) surface.normals.push_back(Eigen::Vector3d(values[3], values[4], values[5]).cast<float>());
  }
}

/// Faces are kept aside until all elements are read: their points may come after them.
struct Faces {
  std::vector<long long> corners;
  std::vector<std::size_t> ends;
};

Faces read_faces(const Element& element, Numbers& numbers) {
  const auto is_corners = [](const Property& property) {
    return property.is_list && (property.name == "vertex_indices" || property.name == "vertex_index");
  };
  if (element.count > 0 && std::none_of(element.properties.begin(), element.properties.end(), is_corners)) {
    throw ScanRefusal{R"(element "face": takes a property list "vertex_indices" (or "vertex_index"); export it again)"};
  }
  Faces faces;
  faces.ends.reserve(static_cast<std::size_t>(element.count));
  for (long long i = 0; i < element.count; ++i) {
    numbers.begin(element, i);
    for (const Property& property : element.properties)
      take_property(numbers, property, is_corners(property) ? &faces.corners : nullptr);
    faces.ends.push_back(faces.corners.size());
  }
  return faces;
}

}  // namespace

RawSurface read_ply(std::string_view bytes) {
  TextCursor text(bytes);
  const PlyHeader header = read_ply_header(text);
  Numbers numbers(text, header.encoding);
  RawSurface surface;
  Faces faces;
  bool has_vertices = false;
  bool has_faces = false;
  for (const Element& element : header.elements) {
    check_room(element, numbers, header.encoding);
    if (element.name == "vertex") {
      if (has_vertices) throw ScanRefusal{"element \"vertex\": is there twice; export it again"};
      read_vertices(element, numbers, surface);
      has_vertices = true;
    } else if (element.name == "face") {
      if (has_faces) throw ScanRefusal{"element \"face\": is there twice; export it again"};
      faces = read_faces(element, numbers);
      has_faces = true;
    } else if (element.name == "tristrips" && element.count > 0) {
      throw ScanRefusal{"element \"tristrips\": triangle strips are not read; export it with faces"};
    } else {
      for (long long i = 0; i < element.count; ++i) {
        numbers.begin(element, i);
        for (const Property& property : element.properties) take_property(numbers, property, nullptr);
      }
    }
  }
  if (!has_vertices) throw ScanRefusal{"element \"vertex\": is missing in the header; this file has no points"};
  std::size_t first = 0;
  for (std::size_t i = 0; i < faces.ends.size(); ++i) {
    const std::span<const long long> corners(faces.corners);
    add_polygon(surface, corners.subspan(first, faces.ends[i] - first), "face", static_cast<long long>(i));
    first = faces.ends[i];
  }
  return surface;
}

}  // namespace tubetrack
