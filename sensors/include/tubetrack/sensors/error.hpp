#pragma once

#include <string>
#include <tl/expected.hpp>

namespace tubetrack {

/// What went wrong, in one line that names the file or option, the field, the value and the fix.
struct Error {
  /// `usage`: the caller asked for something impossible (exit code 2); `failed`: the data or device let us down (1).
  enum class Kind { usage, failed };

  Kind kind = Kind::failed;
  std::string message;

  static Error usage(std::string text) { return {Kind::usage, std::move(text)}; }
  static Error failed(std::string text) { return {Kind::failed, std::move(text)}; }
};

template <class T>
using Expected = tl::expected<T, Error>;

}  // namespace tubetrack
