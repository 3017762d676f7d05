#include "mono_pixels.hpp"

#include <cstring>

namespace tubetrack {

std::size_t mono_row_bytes(MonoPacking packing, int width) {
  const auto pixels = static_cast<std::size_t>(width);
  switch (packing) {
    case MonoPacking::bytes:
      return pixels;
    case MonoPacking::words:
      return 2 * pixels;
    case MonoPacking::csi2_ten_bits:
      return pixels % 4 == 0 ? pixels / 4 * 5 : 0;
  }
  return 0;
}

void unpack_mono(MonoPacking packing, const std::byte* from, std::size_t stride_bytes, int width, int height,
                 std::uint16_t* to) {
  for (int v = 0; v < height; ++v, to += width) {
    const std::byte* row = from + static_cast<std::size_t>(v) * stride_bytes;
    if (packing == MonoPacking::words) {
      std::memcpy(to, row, 2 * static_cast<std::size_t>(width));
      continue;
    }
    for (int u = 0; u < width; ++u) {
      if (packing == MonoPacking::bytes) {
        to[u] = std::to_integer<std::uint16_t>(row[u]);
      } else {
        const std::byte* four = row + u / 4 * 5;
        const unsigned low = std::to_integer<unsigned>(four[4]) >> (2 * (u % 4)) & 3U;
        to[u] = static_cast<std::uint16_t>(std::to_integer<unsigned>(four[u % 4]) << 2 | low);
      }
    }
  }
}

}  // namespace tubetrack
