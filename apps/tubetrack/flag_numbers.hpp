#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// One line with the flag, the value and the form it takes.
inline tl::unexpected<Error> malformed(std::string_view flag, const std::string& value, std::string_view form) {
  return tl::make_unexpected(Error::usage(fmt::format("{} {}: takes {}", flag, value.empty() ? "''" : value, form)));
}

/// The whole text as a finite number; nothing where it is none.
template <class Number>
std::optional<Number> number_from(std::string_view text) {
  Number number{};
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || problem != std::errc() || end != text.data() + text.size()) return {};
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(number)) return {};
  }
  return number;
}

/// Exactly n numbers with `separator` between them.
template <class Number, std::size_t n>
std::optional<std::array<Number, n>> numbers_from(std::string_view text, char separator) {
  std::array<Number, n> numbers{};
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t end = i + 1 == n ? text.size() : text.find(separator);
    if (end == std::string_view::npos) return {};
    const auto number = number_from<Number>(text.substr(0, end));
    if (!number) return {};
    numbers[i] = *number;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return numbers;
}

}  // namespace tubetrack
