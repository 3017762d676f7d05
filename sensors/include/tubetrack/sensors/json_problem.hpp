#pragma once

#include <exception>
#include <string>

namespace tubetrack {

/// What a reader of JSON complains of, without the library's own "[json.exception.…] " before it.
inline std::string json_problem(const std::exception& problem) {
  const std::string what = problem.what();
  return what.starts_with("[json.exception.") ? what.substr(what.find(' ') + 1) : what;
}

}  // namespace tubetrack
