#pragma once

#include <cstdint>
#include <vector>

#include "emulated_machine/usb_camera.hpp"

namespace tubetrack::test {

/// What USB devices say about themselves when asked (little endian throughout).
std::vector<std::uint8_t> device_descriptor();
std::vector<std::uint8_t> configuration_descriptor(const UsbCameraSettings& settings);
/// 0: the languages; 1: the maker; others: the name.
std::vector<std::uint8_t> string_descriptor(int index);

/// The lowest `bytes` bytes of `value`.
void append(std::vector<std::uint8_t>& to, std::uint32_t value, int bytes);
int bits_per_pixel(const std::string& format);

inline constexpr std::uint32_t kPayloadBytes = 16384;  ///< of one transfer of pixels, with its header

}  // namespace tubetrack::test
