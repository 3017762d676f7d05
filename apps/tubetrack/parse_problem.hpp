#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace tubetrack {

/// What is wrong with the arguments, in one line: the flag, what it got, what it takes, and whose --help to see.
std::string parse_problem(const CLI::App& app, const CLI::ParseError& problem);

}  // namespace tubetrack
