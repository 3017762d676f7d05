#include "emulated_machine/usb_descriptors.hpp"

#include <initializer_list>
#include <string>

namespace tubetrack::test {

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kInterface = 4, kEndpoint = 5, kInterfaceAssociation = 11, kOfClass = 0x24;
constexpr std::uint32_t kVideo = 0x0e, kControl = 1, kStreaming = 2;

Bytes bytes_of(std::initializer_list<std::uint32_t> values) {
  return {values.begin(), values.end()};
}

void append(Bytes& to, const Bytes& more) {
  to.insert(to.end(), more.begin(), more.end());
}

/// One image size that a format comes in.
Bytes frame_descriptor(const UsbCameraSettings& settings, const std::string& format) {
  const auto width = static_cast<std::uint32_t>(settings.width);
  const auto height = static_cast<std::uint32_t>(settings.height);
  const auto fps = static_cast<std::uint32_t>(settings.frames_per_second);
  const std::uint32_t image_bits = width * height * static_cast<std::uint32_t>(bits_per_pixel(format));
  Bytes all = bytes_of({30, kOfClass, 5, 1, 0});
  test::append(all, width, 2);
  test::append(all, height, 2);
  test::append(all, image_bits * fps, 4);
  test::append(all, image_bits * fps, 4);
  test::append(all, image_bits / 8, 4);
  test::append(all, 10000000 / fps, 4);  // 100 ns
  test::append(all, 1, 1);
  test::append(all, 10000000 / fps, 4);
  return all;
}

/// A format is told by a GUID that begins with its four characters.
Bytes format_descriptor(std::uint32_t index, const std::string& format) {
  Bytes all = bytes_of({27, kOfClass, 4, index, 1});
  all.insert(all.end(), format.begin(), format.end());
  append(all, bytes_of({0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71}));
  append(all, bytes_of({static_cast<std::uint32_t>(bits_per_pixel(format)), 1, 0, 0, 0, 0}));
  return all;
}

Bytes control_interface() {
  const Bytes camera = bytes_of({18, kOfClass, 2, 1, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0});
  const Bytes output = bytes_of({9, kOfClass, 3, 2, 0x01, 0x01, 0, 1, 0});
  Bytes all = bytes_of({9, kInterface, 0, 0, 0, kVideo, kControl, 0, 0});
  append(all, bytes_of({13, kOfClass, 1, 0x10, 0x01}));
  test::append(all, static_cast<std::uint32_t>(13 + camera.size() + output.size()), 2);
  test::append(all, 6000000, 4);  // Hz, of a clock
  append(all, bytes_of({1, 1}));
  append(all, camera);
  append(all, output);
  return all;
}

Bytes streaming_interface(const UsbCameraSettings& settings) {
  Bytes formats;
  std::uint32_t index = 0;
  for (const std::string& format : settings.formats) {
    append(formats, format_descriptor(++index, format));
    append(formats, frame_descriptor(settings, format));
  }
  Bytes all = bytes_of({9, kInterface, 1, 0, 1, kVideo, kStreaming, 0, 0});
  append(all, bytes_of({13 + index, kOfClass, 1, index}));
  test::append(all, static_cast<std::uint32_t>(13 + index + formats.size()), 2);
  append(all, bytes_of({0x81, 0, 2, 0, 0, 0, 1}));
  append(all, Bytes(index, 0));
  append(all, formats);
  append(all, bytes_of({7, kEndpoint, 0x81, 2, 0, 2, 0}));  // bulk, 512 bytes
  return all;
}

}  // namespace

void append(Bytes& to, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) to.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

int bits_per_pixel(const std::string& format) {
  return format == "GREY" ? 8 : 16;
}

Bytes device_descriptor() {
  return bytes_of({18, 1, 0x00, 0x02, 0xef, 2, 1, 64, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 1, 2, 0, 1});
}

Bytes configuration_descriptor(const UsbCameraSettings& settings) {
  Bytes all = bytes_of({9, 2, 0, 0, 2, 1, 0, 0x80, 50});
  append(all, bytes_of({8, kInterfaceAssociation, 0, 2, kVideo, 3, 0, 0}));
  append(all, control_interface());
  append(all, streaming_interface(settings));
  all[2] = static_cast<std::uint8_t>(all.size());
  all[3] = static_cast<std::uint8_t>(all.size() >> 8);
  return all;
}

Bytes string_descriptor(int index) {
  if (index == 0) return bytes_of({4, 3, 0x09, 0x04});  // English
  const std::string text = index == 1 ? "tubetrack" : "USB depth camera";
  Bytes all = bytes_of({static_cast<std::uint32_t>(2 + 2 * text.size()), 3});
  for (const char letter : text) append(all, static_cast<std::uint8_t>(letter), 2);
  return all;
}

}  // namespace tubetrack::test
