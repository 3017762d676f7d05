#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <map>

#include "scan_volume.hpp"

namespace tubetrack {

namespace {

/// The "Key = value" lines of a MetaImage header; ElementDataFile is the last one, and data may follow it.
struct MhdHeader {
  std::map<std::string, std::string, std::less<>> values;
  std::uint64_t end = 0;  ///< the byte behind the header

  /// The value of the first of several names that is there; empty when none is.
  std::string value(std::initializer_list<std::string_view> names) const {
    for (const std::string_view name : names) {
      if (const auto found = values.find(name); found != values.end()) return found->second;
    }
    return {};
  }
  bool is_true(std::initializer_list<std::string_view> names) const {
    const std::string text = value(names);
    return text == "True" || text == "true" || text == "1";
  }
};

std::string trimmed(std::string_view text) {
  constexpr std::string_view blanks = " \t\r";
  const std::size_t begin = text.find_first_not_of(blanks);
  if (begin == std::string_view::npos) return {};
  return std::string(text.substr(begin, text.find_last_not_of(blanks) - begin + 1));
}

MhdHeader read_mhd_header(const std::filesystem::path& path) {
  const std::string start = read_header_text(path);
  TextCursor text(start);
  MhdHeader header;
  std::string_view line;
  while (text.next_line(line)) {
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos) {
      if (trimmed(line).empty()) continue;
      throw ScanRefusal{fmt::format("line {}: got {}, takes \"Key = value\"; this is no MetaImage header", text.line(),
                                    in_quotes(line))};
    }
    const std::string key = trimmed(line.substr(0, equals));
    header.values[key] = trimmed(line.substr(equals + 1));
    header.end = start.size() - text.rest().size();
    if (key == "ElementDataFile") return header;
  }
  throw ScanRefusal{"ElementDataFile: is missing; the header was cut off, or this is no MetaImage"};
}

template <class T>
std::optional<std::vector<T>> numbers(const MhdHeader& header, std::initializer_list<std::string_view> names,
                                      std::size_t count) {
  const std::string text = header.value(names);
  if (text.empty()) return std::nullopt;
  std::string_view rest = text;
  std::vector<T> values;
  for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) {
    const auto value = number_in(word);
    if (!value || !(std::abs(*value) < 1e15)) {
      throw ScanRefusal{
          fmt::format("{}: got {}, takes {} numbers; correct the header", *names.begin(), in_quotes(word), count)};
    }
    values.push_back(static_cast<T>(*value));
  }
  if (values.size() != count) {
    throw ScanRefusal{
        fmt::format("{}: got {}, takes {} numbers; correct the header", *names.begin(), in_quotes(text), count)};
  }
  return values;
}

NumberType element_type(const MhdHeader& header) {
  using enum NumberType;
  constexpr std::array<std::pair<std::string_view, NumberType>, 12> known = {{{"MET_CHAR", int8},
                                                                              {"MET_UCHAR", uint8},
                                                                              {"MET_SHORT", int16},
                                                                              {"MET_USHORT", uint16},
                                                                              {"MET_INT", int32},
                                                                              {"MET_UINT", uint32},
                                                                              {"MET_LONG", int32},
                                                                              {"MET_ULONG", uint32},
                                                                              {"MET_LONG_LONG", int64},
                                                                              {"MET_ULONG_LONG", uint64},
                                                                              {"MET_FLOAT", float32},
                                                                              {"MET_DOUBLE", float64}}};
  const std::string name = header.value({"ElementType"});
  for (const auto& [text, type] : known) {
    if (text == name) return type;
  }
  throw ScanRefusal{
      fmt::format("ElementType: got {}, takes MET_UCHAR, MET_SHORT, MET_FLOAT or another plain number; "
                  "export it again",
                  in_quotes(name))};
}

void refuse_what_is_not_read(const MhdHeader& header) {
  const std::string dimensions = header.value({"NDims"});
  if (dimensions != "3") throw ScanRefusal{fmt::format("NDims: got {}, takes 3", in_quotes(dimensions))};
  const std::string channels = header.value({"ElementNumberOfChannels"});
  if (!channels.empty() && channels != "1")
    throw ScanRefusal{fmt::format("ElementNumberOfChannels: got {}, takes 1", in_quotes(channels))};
  const std::string data = header.value({"ElementDataFile"});
  if (data.empty() || data.starts_with("LIST") || data.find('%') != std::string::npos) {
    throw ScanRefusal{fmt::format("ElementDataFile: got {}, takes one file's name, or LOCAL; export it as one file",
                                  in_quotes(data))};
  }
  const std::string binary = header.value({"BinaryData"});
  if (binary == "False" || binary == "false" || binary == "0")
    throw ScanRefusal{"BinaryData: got False, takes True; export it as binary data"};
}

/// Where a voxel is: MetaImage keeps the direction of each axis in a row of TransformMatrix.
void place_grid(const MhdHeader& header, VoxelGrid& grid) {
  const auto spacing = numbers<double>(header, {"ElementSpacing", "ElementSize"}, 3);
  const auto offset = numbers<double>(header, {"Offset", "Position", "Origin"}, 3);
  const auto directions = numbers<double>(header, {"TransformMatrix", "Rotation", "Orientation"}, 9);
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    const double step = spacing ? (*spacing)[k] : 1.0;
    if (!(step > 0.0))
      throw ScanRefusal{fmt::format("ElementSpacing: got {:g}, takes mm, above 0; correct the header", step)};
    Eigen::Vector3d direction = Eigen::Vector3d::Unit(axis);
    if (directions) direction = Eigen::Map<const Eigen::Vector3d>(directions->data() + 3 * k);
    grid.axes_m.col(axis) = step * direction;
    if (offset) grid.origin_m[axis] = (*offset)[k];
  }
  require_axes(grid.axes_m, "TransformMatrix");
}

}  // namespace

RawVolume read_mhd(const std::filesystem::path& path, const ScanOptions& options) {
  const MhdHeader header = read_mhd_header(path);
  refuse_what_is_not_read(header);
  const auto sizes = numbers<long long>(header, {"DimSize"}, 3);
  if (!sizes) throw ScanRefusal{"DimSize: is missing; add the three sizes in voxels"};
  const std::array<long long, 3> size{(*sizes)[0], (*sizes)[1], (*sizes)[2]};
  VoxelEncoding encoding{element_type(header), false, 1.0, 0.0};
  const bool big = header.is_true({"BinaryDataByteOrderMSB", "ElementByteOrderMSB"});
  encoding.swapped = big != (std::endian::native == std::endian::big);
  RawVolume volume;
  place_grid(header, volume.grid);
  if (!header.value({"ElementSpacing", "ElementSize"}).empty()) volume.metres_per_unit = kMetresPerMillimetre;

  const std::string name = header.value({"ElementDataFile"});
  const bool local = name == "LOCAL" || name == "Local" || name == "local";
  const std::filesystem::path data = local ? path : path.parent_path() / name;
  std::error_code error;
  const auto bytes = std::filesystem::file_size(data, error);
  if (error) {
    throw ScanRefusal{fmt::format("ElementDataFile: {} cannot be read: {}; put it beside the header", data.string(),
                                  error.message())};
  }
  const bool compressed = header.is_true({"CompressedData"});
  std::uint64_t begin = local ? header.end : 0;
  if (const auto skip = numbers<long long>(header, {"HeaderSize"}, 1); skip && !local) {
    const double voxels = static_cast<double>(size[0]) * static_cast<double>(size[1]) * static_cast<double>(size[2]);
    const double from_end = static_cast<double>(bytes) - voxels * static_cast<double>(size_of(encoding.type));
    // −1: the data are the end of the file.
    const double wanted = (*skip)[0] >= 0 ? static_cast<double>((*skip)[0]) : from_end;
    begin = static_cast<std::uint64_t>(std::clamp(wanted, 0.0, static_cast<double>(bytes)));
  }
  const double data_bytes = static_cast<double>(bytes) - static_cast<double>(std::min<std::uint64_t>(begin, bytes));
  require_volume_fits(size, encoding, compressed ? -1.0 : data_bytes, options);
  ByteStream stream(data, begin, compressed);
  read_voxels(stream, size, encoding, options, volume);
  return volume;
}

}  // namespace tubetrack
