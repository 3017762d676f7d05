#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// One line of a TUM text file.
struct TextLine {
  int number = 0;  ///< from 1
  std::string text;
  bool unfinished = false;  ///< the file ends here without a line end: its writer may have been killed
};

/// The lines of a file without comments (#), empty lines and surrounding blanks. Error::failed where it can't be read.
Expected<std::vector<TextLine>> read_text_lines(const std::filesystem::path& path);

/// Cuts the first blank-separated word off `text`; empty when none is left.
std::string_view take_word(std::string_view& text);

/// The number a word spells in full; empty when it spells none, or one that is not finite.
std::optional<double> parse_number(std::string_view word);

}  // namespace tubetrack
