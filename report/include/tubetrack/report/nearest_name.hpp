#pragma once

#include <optional>
#include <string>
#include <vector>

namespace tubetrack {

/// Of the known names the one that a mistyped one was probably meant to be; empty where none is near.
std::optional<std::string> nearest_name(const std::string& typed, const std::vector<std::string>& known);

}  // namespace tubetrack
