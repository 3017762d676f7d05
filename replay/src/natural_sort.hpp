#pragma once

#include <string_view>

namespace tubetrack {

/// Order people expect of file names: runs of digits compare by value, so frame_9 comes before frame_10. A strict total
/// order: names that differ only in leading zeros fall back to plain comparison.
bool natural_less(std::string_view a, std::string_view b);

}  // namespace tubetrack
