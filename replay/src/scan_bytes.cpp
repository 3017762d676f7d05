#include "scan_bytes.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <fstream>

namespace tubetrack {

namespace {

constexpr std::string_view kBlanks = " \t\r\n\v\f";

template <class T>
double load(const char* bytes, bool swapped) {
  std::array<char, sizeof(T)> raw{};
  std::memcpy(raw.data(), bytes, sizeof(T));
  if (swapped) std::reverse(raw.begin(), raw.end());
  return static_cast<double>(std::bit_cast<T>(raw));
}

template <class T>
std::optional<T> parsed(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

}  // namespace

std::size_t default_memory_limit_bytes() {
  const long pages = ::sysconf(_SC_PHYS_PAGES);
  const long page_bytes = ::sysconf(_SC_PAGESIZE);
  constexpr std::size_t kUnknown = std::size_t{1} << 31U;
  if (pages <= 0 || page_bytes <= 0) return kUnknown;
  return static_cast<std::size_t>(pages) * static_cast<std::size_t>(page_bytes) / 2;
}

std::string human_size(double bytes) {
  constexpr std::array<const char*, 5> units = {"bytes", "KB", "MB", "GB", "TB"};
  std::size_t unit = 0;
  for (; bytes >= 1000.0 && unit + 1 < units.size(); ++unit) bytes /= 1000.0;
  return fmt::format("{:.3g} {}", bytes, units[unit]);
}

std::string read_whole_file(const std::filesystem::path& path, std::size_t limit_bytes) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error) throw ScanRefusal{fmt::format("cannot be read: {}; check that it is a readable file", error.message())};
  if (size == 0) throw ScanRefusal{"is empty (0 bytes); copy or export it again"};
  if (size > limit_bytes) {
    throw ScanRefusal{fmt::format("has {}, takes at most {} (half of the memory here); make it coarser or cut it up",
                                  human_size(static_cast<double>(size)), human_size(static_cast<double>(limit_bytes)))};
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) throw ScanRefusal{fmt::format("cannot be opened: {}; check the rights", std::strerror(errno))};
  std::string bytes(size, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(file.gcount()) != size) throw ScanRefusal{"cannot be read to its end; copy it again"};
  return bytes;
}

std::string read_header_text(const std::filesystem::path& path) {
  constexpr std::size_t kMost_bytes = 1U << 16U;
  std::ifstream file(path, std::ios::binary);
  std::string text(kMost_bytes, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

bool TextCursor::next_line(std::string_view& line) {
  if (rest_.empty()) return false;
  const std::size_t end = rest_.find('\n');
  line = rest_.substr(0, end);
  rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  ++line_;
  return true;
}

bool TextCursor::next_content(std::string_view& line, char comment) {
  while (next_line(line)) {
    line = line.substr(0, line.find(comment));
    if (line.find_first_not_of(kBlanks) != std::string_view::npos) return true;
  }
  return false;
}

std::string_view next_word(std::string_view& text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) {
    text = {};
    return {};
  }
  text.remove_prefix(begin);
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  text.remove_prefix(word.size());
  return word;
}

std::optional<double> number_in(std::string_view word) {
  return parsed<double>(word);
}
std::optional<long long> integer_in(std::string_view word) {
  return parsed<long long>(word);
}

double take_number(std::string_view& text, std::string_view field, int line) {
  const std::string_view word = next_word(text);
  if (const auto value = number_in(word)) return *value;
  throw ScanRefusal{fmt::format("line {}: {}: got {}, takes a number with a decimal point; correct or export it again",
                                line, field, in_quotes(word))};
}

long long take_integer(std::string_view& text, std::string_view field, int line) {
  const std::string_view word = next_word(text);
  if (const auto value = integer_in(word)) return *value;
  throw ScanRefusal{fmt::format("line {}: {}: got {}, takes a whole number; correct or export it again", line, field,
                                in_quotes(word))};
}

std::string in_quotes(std::string_view word) {
  if (word.empty()) return "nothing";
  std::string text = "\"";
  for (const char c : word.substr(0, 40)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + (word.size() > 40 ? "…\"" : "\"");
}

std::size_t size_of(NumberType type) {
  switch (type) {
    case NumberType::int8:
    case NumberType::uint8:
      return 1;
    case NumberType::int16:
    case NumberType::uint16:
      return 2;
    case NumberType::int32:
    case NumberType::uint32:
    case NumberType::float32:
      return 4;
    default:
      return 8;
  }
}

double load_number(const char* bytes, NumberType type, bool swapped) {
  switch (type) {
    case NumberType::int8:
      return load<std::int8_t>(bytes, swapped);
    case NumberType::uint8:
      return load<std::uint8_t>(bytes, swapped);
    case NumberType::int16:
      return load<std::int16_t>(bytes, swapped);
    case NumberType::uint16:
      return load<std::uint16_t>(bytes, swapped);
    case NumberType::int32:
      return load<std::int32_t>(bytes, swapped);
    case NumberType::uint32:
      return load<std::uint32_t>(bytes, swapped);
    case NumberType::int64:
      return load<std::int64_t>(bytes, swapped);
    case NumberType::uint64:
      return load<std::uint64_t>(bytes, swapped);
    case NumberType::float32:
      return load<float>(bytes, swapped);
    default:
      return load<double>(bytes, swapped);
  }
}

void require_room(std::string_view what, double count, double bytes_each, double available) {
  if (count >= 0.0 && count * bytes_each <= available) return;
  throw ScanRefusal{
      fmt::format("the header says {:.0f} {}, which take at least {}, but only {} follow; it was cut off "
                  "or the header is wrong: copy or export it again",
                  count, what, human_size(count * bytes_each), human_size(available))};
}

}  // namespace tubetrack
