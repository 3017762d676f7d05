#pragma once

#include <string>
#include <string_view>

#include "figures.hpp"

namespace tubetrack::bench {

// For the terminal: one line for a row's single frames, one for its sequences, one for their last frames.

std::string plain_header();
std::string plain_line(std::string_view row, std::string_view what, const Figures& figures);

}  // namespace tubetrack::bench
