#include "text_lines.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>

namespace tubetrack {

namespace {

constexpr std::string_view kBlanks = " \t\r\n\v\f";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

}  // namespace

Expected<std::vector<TextLine>> read_text_lines(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) {
    return tl::make_unexpected(Error::failed(fmt::format(
        "{}: cannot be opened: {}; check that it is there and readable", path.string(), std::strerror(errno))));
  }
  std::vector<TextLine> lines;
  std::string text;
  for (int number = 1; std::getline(file, text); ++number) {
    const bool unfinished = file.eof();
    const std::string_view content = trimmed(text);
    if (content.empty() || content.front() == '#') continue;
    lines.push_back({number, std::string(content), unfinished});
  }
  if (file.bad())
    return tl::make_unexpected(Error::failed(fmt::format("{}: cannot be read to its end", path.string())));
  return lines;
}

std::string_view take_word(std::string_view& text) {
  text = trimmed(text);
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  text.remove_prefix(word.size());
  text = trimmed(text);
  return word;
}

std::optional<double> parse_number(std::string_view word) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace tubetrack
