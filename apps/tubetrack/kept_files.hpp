#pragma once

#include <string>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// What a run must not write over: an error (usage) that names the flag, the path and the fix. Empty paths pass.

/// `--out` a file of the recording (its own earlier results, *.jsonl, may be written anew), `--overlay` its images'
/// folder, `--save-heightmap`, or the .json beside that, a file of the recording.
Expected<void> keep_recording(const std::string& recording, const std::string& out, const std::string& overlay,
                              const std::string& save_heightmap);

/// `flag` names what the virtual device plays, or an .oni that is there and is none.
Expected<void> keep_others(const std::string& flag, const std::string& target);

}  // namespace tubetrack
