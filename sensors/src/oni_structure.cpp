#include "oni_structure.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>

namespace tubetrack {

namespace {

constexpr std::int64_t kHeaderBytes = 24;
constexpr std::size_t kRecordHeaderBytes = 28;
constexpr std::uint32_t kRecordMagic = 0x0052494e;  // "NIR"
constexpr std::uint32_t kFrame = 0x0a;
constexpr std::uint32_t kEnd = 0x0b;

std::uint32_t word_at(const std::array<char, kRecordHeaderBytes>& bytes, std::size_t offset) {
  std::uint32_t word = 0;  // little endian, like every machine that OpenNI2 runs on
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

}  // namespace

std::string oni_structure_problem(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) return "it can't be opened";
  const auto size = static_cast<std::int64_t>(in.tellg());
  std::array<char, 4> magic{};
  in.seekg(0);
  if (!in.read(magic.data(), magic.size()) || std::memcmp(magic.data(), "NI10", 4) != 0) return "it is no .oni file";
  std::int64_t frames = 0;
  std::array<char, kRecordHeaderBytes> record{};
  for (std::int64_t at = kHeaderBytes; at + static_cast<std::int64_t>(kRecordHeaderBytes) <= size;) {
    in.seekg(at);
    if (!in.read(record.data(), record.size()) || word_at(record, 0) != kRecordMagic) break;
    const std::uint32_t type = word_at(record, 4);
    if (type == kEnd) return {};
    const std::int64_t bytes = std::int64_t{word_at(record, 12)} + std::int64_t{word_at(record, 16)};
    if (bytes < static_cast<std::int64_t>(kRecordHeaderBytes)) break;
    at += bytes;
    if (type == kFrame && at <= size) ++frames;
  }
  return fmt::format("it is cut, or damaged, after {} frame(s)", frames);
}

}  // namespace tubetrack
