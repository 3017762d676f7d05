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
constexpr std::uint32_t kFramesFollow = 0x08;
constexpr std::uint32_t kFrame = 0x0a;
constexpr std::uint32_t kEnd = 0x0b;

std::uint32_t word_at(const std::array<char, kRecordHeaderBytes>& bytes, std::size_t offset) {
  std::uint32_t word = 0;  // little endian, like every machine that OpenNI2 runs on
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

struct Structure {
  bool readable = false;
  bool is_oni = false;
  bool begun = false;  ///< the record that frames follow is there
  bool ended = false;  ///< by the record that comes last
  std::int64_t frames = 0;
};

Structure read_structure(const std::filesystem::path& path) {
  Structure found;
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) return found;
  found.readable = true;
  const auto size = static_cast<std::int64_t>(in.tellg());
  std::array<char, 4> magic{};
  in.seekg(0);
  if (!in.read(magic.data(), magic.size()) || std::memcmp(magic.data(), "NI10", 4) != 0) return found;
  found.is_oni = true;
  std::array<char, kRecordHeaderBytes> record{};
  for (std::int64_t at = kHeaderBytes; at + static_cast<std::int64_t>(kRecordHeaderBytes) <= size;) {
    in.seekg(at);
    if (!in.read(record.data(), record.size()) || word_at(record, 0) != kRecordMagic) break;
    const std::uint32_t type = word_at(record, 4);
    if (type == kEnd) {
      found.ended = true;
      return found;
    }
    const std::int64_t bytes = std::int64_t{word_at(record, 12)} + std::int64_t{word_at(record, 16)};
    if (bytes < static_cast<std::int64_t>(kRecordHeaderBytes)) break;
    at += bytes;
    if (type == kFramesFollow) found.begun = true;
    if (type == kFrame && at <= size) ++found.frames;
  }
  return found;
}

}  // namespace

bool oni_takes_frames(const std::filesystem::path& path) {
  return read_structure(path).begun;
}

std::int64_t oni_frames_so_far(const std::filesystem::path& path) {
  return read_structure(path).frames;
}

std::string oni_structure_problem(const std::filesystem::path& path) {
  const Structure found = read_structure(path);
  if (!found.readable) return "it can't be opened";
  if (!found.is_oni) return "it is no .oni file";
  if (!found.ended) return fmt::format("it is cut, or damaged, after {} frame(s)", found.frames);
  return {};
}

}  // namespace tubetrack
