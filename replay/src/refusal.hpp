#pragma once

#include <string>

namespace tubetrack {

/// Thrown inside a reader that can go no further with its file, and caught before it returns.
struct Refusal {
  std::string text;  ///< names the field, the value and what it takes
};

}  // namespace tubetrack
