#pragma once

#include <filesystem>
#include <string>

namespace tubetrack {

/// Why a file is no whole .oni: not there, none at all, or cut; empty where all its records are there, up to the last
/// one. The runtime opens some files that are cut, and plays what it finds.
std::string oni_structure_problem(const std::filesystem::path& path);

}  // namespace tubetrack
