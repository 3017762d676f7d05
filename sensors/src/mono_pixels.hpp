#pragma once

#include <cstddef>
#include <cstdint>

namespace tubetrack {

/// How grey values lie in memory.
enum class MonoPacking {
  bytes,          ///< one byte a pixel
  words,          ///< 16 bits a pixel, little endian, the value in the low bits
  csi2_ten_bits,  ///< four pixels in five bytes: their high eight bits, then the low two of each
};

/// The bytes that a row needs; 0 for a csi2 row of a width that is no multiple of 4.
std::size_t mono_row_bytes(MonoPacking packing, int width);

/// Unpacks width × height grey values, dense. Rows begin `stride_bytes` apart.
void unpack_mono(MonoPacking packing, const std::byte* from, std::size_t stride_bytes, int width, int height,
                 std::uint16_t* to);

}  // namespace tubetrack
