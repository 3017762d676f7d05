#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace tubetrack {

/// Whether a recorder has come so far that it takes frames.
bool oni_takes_frames(const std::filesystem::path& path);

/// How many whole frames are in a file, finished or not.
std::int64_t oni_frames_so_far(const std::filesystem::path& path);

/// Why a file is no whole .oni: not there, none at all, or cut; empty where all its records are there, up to the last
/// one. The runtime opens some files that are cut, and plays what it finds.
std::string oni_structure_problem(const std::filesystem::path& path);

}  // namespace tubetrack
