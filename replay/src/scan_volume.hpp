#pragma once

#include <zlib.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <vector>

#include "scan_bytes.hpp"
#include "scan_readers.hpp"

namespace tubetrack {

/// The bytes of a file from an offset on, inflated on the way where they are compressed (gzip or zlib, told apart by
/// their first bytes). A volume is never in memory as the file has it.
class ByteStream {
 public:
  ByteStream(const std::filesystem::path& path, std::uint64_t offset, bool compressed);
  ~ByteStream();
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  /// How many bytes it gave; fewer than asked for only at the end. Throws ScanRefusal where compressed data are
  /// damaged.
  std::size_t read(char* to, std::size_t count);

 private:
  void refill();
  std::size_t inflate_some(char* to, std::size_t count);

  std::ifstream file_;
  bool compressed_;
  bool ended_ = false;
  std::vector<char> packed_;
  z_stream inflater_{};
};

/// How a volume's voxels are stored.
struct VoxelEncoding {
  NumberType type = NumberType::uint8;
  bool swapped = false;
  double slope = 1.0;  ///< value = slope · stored + intercept
  double intercept = 0.0;
};

/// Throws ScanRefusal for sizes that are none, and for volumes that take more than the options allow: from the header
/// alone, before anything is allocated. `data_bytes`: of the uncompressed data that follow; negative: not known.
void require_volume_fits(const std::array<long long, 3>& size, const VoxelEncoding& encoding, double data_bytes,
                         const ScanOptions& options);

/// Fills volume.grid.inside from the stream. Throws ScanRefusal where data end early, where no voxel or every voxel is
/// in the body, and where neither a label nor a threshold says which of several values is.
void read_voxels(ByteStream& stream, const std::array<long long, 3>& size, const VoxelEncoding& encoding,
                 const ScanOptions& options, RawVolume& volume);

/// Throws ScanRefusal unless the three axes span a volume.
void require_axes(const Eigen::Matrix3d& axes, std::string_view field);

}  // namespace tubetrack
