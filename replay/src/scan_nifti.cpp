#include <fmt/format.h>

#include <Eigen/Geometry>
#include <bit>
#include <cmath>
#include <cstring>

#include "scan_volume.hpp"

namespace tubetrack {

namespace {

constexpr std::size_t kNiftiHeader_bytes = 348;

/// Fields of a NIfTI-1 header, by their place in it.
class NiftiHeader {
 public:
  NiftiHeader(const std::array<char, kNiftiHeader_bytes>& bytes, bool swapped) : bytes_(bytes), swapped_(swapped) {}

  double float_at(std::size_t place) const { return load_number(bytes_.data() + place, NumberType::float32, swapped_); }
  int short_at(std::size_t place) const {
    return static_cast<int>(load_number(bytes_.data() + place, NumberType::int16, swapped_));
  }
  int byte_at(std::size_t place) const { return static_cast<unsigned char>(bytes_[place]); }
  bool swapped() const { return swapped_; }

 private:
  std::array<char, kNiftiHeader_bytes> bytes_;
  bool swapped_;
};

constexpr std::size_t kDim = 40, kDatatype = 70, kPixdim = 76, kVoxOffset = 108, kSlope = 112, kIntercept = 116,
                      kUnits = 123, kQformCode = 252, kSformCode = 254, kQuaternion = 256, kQoffset = 268, kSrow = 280,
                      kMagic = 344;

NiftiHeader read_nifti_header(ByteStream& stream) {
  std::array<char, kNiftiHeader_bytes> bytes{};
  if (stream.read(bytes.data(), bytes.size()) != bytes.size())
    throw ScanRefusal{"ends in its header of 348 bytes; it was cut off: copy or export it again"};
  const double size = load_number(bytes.data(), NumberType::int32, false);
  const double other = load_number(bytes.data(), NumberType::int32, true);
  if (size == 540.0 || other == 540.0) throw ScanRefusal{"is NIfTI-2, takes NIfTI-1; export it as NIfTI-1"};
  if ((size != 348.0 && other != 348.0) || std::memcmp(bytes.data() + kMagic, "n+1", 4) != 0) {
    throw ScanRefusal{
        "magic: takes \"n+1\" (a single .nii file); this is no NIfTI file, or one of a .hdr/.img pair: "
        "export it as .nii"};
  }
  return {bytes, size != 348.0};
}

std::array<long long, 3> size_of_volume(const NiftiHeader& header) {
  const int dimensions = header.short_at(kDim);
  std::array<long long, 3> size{1, 1, 1};
  if (dimensions < 1 || dimensions > 7)
    throw ScanRefusal{fmt::format("dim[0]: got {}, takes 1 to 7; the header is damaged", dimensions)};
  for (int k = 1; k <= dimensions; ++k) {
    const int cells = header.short_at(kDim + 2 * static_cast<std::size_t>(k));
    if (k <= 3) size[static_cast<std::size_t>(k - 1)] = cells;
    if (k > 3 && cells != 1)
      throw ScanRefusal{fmt::format("dim[{}]: got {}, takes 1: one volume; take one out of the series", k, cells)};
  }
  return size;
}

NumberType voxel_type(const NiftiHeader& header) {
  using enum NumberType;
  constexpr std::array<std::pair<int, NumberType>, 10> known = {{{2, uint8},
                                                                 {4, int16},
                                                                 {8, int32},
                                                                 {16, float32},
                                                                 {64, float64},
                                                                 {256, int8},
                                                                 {512, uint16},
                                                                 {768, uint32},
                                                                 {1024, int64},
                                                                 {1280, uint64}}};
  const int code = header.short_at(kDatatype);
  for (const auto& [number, type] : known) {
    if (number == code) return type;
  }
  throw ScanRefusal{
      fmt::format("datatype: got {}, takes plain numbers (2, 4, 8, 16, 64, 256, 512, 768, 1024, 1280); "
                  "export it as 8- or 16-bit labels",
                  code)};
}

/// The header's second way to say where voxels are: a quaternion, spacings and an offset.
void place_by_quaternion(const NiftiHeader& header, VoxelGrid& grid) {
  const double b = header.float_at(kQuaternion), c = header.float_at(kQuaternion + 4),
               d = header.float_at(kQuaternion + 8);
  const double a = std::sqrt(std::max(0.0, 1.0 - b * b - c * c - d * d));
  const Eigen::Matrix3d rotation = Eigen::Quaterniond(a, b, c, d).normalized().toRotationMatrix();
  const double flip = header.float_at(kPixdim) < 0.0 ? -1.0 : 1.0;
  for (int k = 0; k < 3; ++k) {
    const auto at = static_cast<std::size_t>(k);
    grid.axes_m.col(k) = rotation.col(k) * std::abs(header.float_at(kPixdim + 4 + 4 * at)) * (k == 2 ? flip : 1.0);
    grid.origin_m[k] = header.float_at(kQoffset + 4 * at);
  }
}

void place_grid(const NiftiHeader& header, const ScanOptions& options, RawVolume& volume) {
  VoxelGrid& grid = volume.grid;
  if (header.short_at(kSformCode) > 0) {
    for (int row = 0; row < 3; ++row) {
      const std::size_t at = kSrow + 16 * static_cast<std::size_t>(row);
      for (int column = 0; column < 3; ++column)
        grid.axes_m(row, column) = header.float_at(at + 4 * static_cast<std::size_t>(column));
      grid.origin_m[row] = header.float_at(at + 12);
    }
  } else if (header.short_at(kQformCode) > 0) {
    place_by_quaternion(header, grid);
  } else {
    for (int k = 0; k < 3; ++k)
      grid.axes_m(k, k) = std::abs(header.float_at(kPixdim + 4 + 4 * static_cast<std::size_t>(k)));
  }
  require_axes(grid.axes_m, "sform, qform or pixdim");
  if (!grid.origin_m.allFinite()) throw ScanRefusal{"sform or qform: the offset is not finite; correct the header"};
  constexpr int kMetre = 1, kMillimetre = 2, kMicrometre = 3;
  const int unit = header.byte_at(kUnits) & 7;
  volume.metres_per_unit = unit == kMetre ? 1.0 : unit == kMicrometre ? 1e-6 : 1e-3;
  if (unit != kMetre && unit != kMillimetre && unit != kMicrometre && !options.unit && !options.cell_size_m)
    volume.notes.emplace_back("the header has no unit: millimetres assumed; if that is wrong, give --unit");
}

}  // namespace

RawVolume read_nifti(const std::filesystem::path& path, const ScanOptions& options) {
  std::array<char, 2> start{};
  ByteStream(path, 0, false).read(start.data(), start.size());
  const bool compressed = start[0] == '\x1f' && start[1] == '\x8b';
  ByteStream stream(path, 0, compressed);
  const NiftiHeader header = read_nifti_header(stream);
  const std::array<long long, 3> size = size_of_volume(header);
  VoxelEncoding encoding{voxel_type(header), header.swapped(), header.float_at(kSlope), header.float_at(kIntercept)};
  if (encoding.slope == 0.0 || !std::isfinite(encoding.slope) || !std::isfinite(encoding.intercept)) {
    encoding.slope = 1.0;  // 0 means "not used"
    encoding.intercept = 0.0;
  }
  const double begin = header.float_at(kVoxOffset);
  constexpr double kMaxOffset_bytes = 1e9;
  if (!(begin >= static_cast<double>(kNiftiHeader_bytes) && begin <= kMaxOffset_bytes))
    throw ScanRefusal{fmt::format("vox_offset: got {:g}, takes 348 or more; the header is damaged", begin)};
  RawVolume volume;
  place_grid(header, options, volume);
  const double data_bytes = compressed ? -1.0 : static_cast<double>(std::filesystem::file_size(path)) - begin;
  if (!compressed && data_bytes < 0.0)
    throw ScanRefusal{"ends before its voxels; it was cut off: copy or export it again"};
  require_volume_fits(size, encoding, data_bytes, options);
  std::array<char, 4096> skipped{};
  for (auto left = static_cast<std::size_t>(begin) - kNiftiHeader_bytes; left > 0;) {
    const std::size_t got = stream.read(skipped.data(), std::min(left, skipped.size()));
    if (got == 0) throw ScanRefusal{"ends before its voxels; it was cut off: copy or export it again"};
    left -= got;
  }
  read_voxels(stream, size, encoding, options, volume);
  return volume;
}

}  // namespace tubetrack
