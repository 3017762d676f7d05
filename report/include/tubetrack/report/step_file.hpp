#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// Writes the tubes as STEP (AP214, millimetres), each a solid of its own named "tube ID", in the frame of the tubes.
/// - With a bend table: true cylinders and tori, as the table says them, and a plane at either end; a ring is one
/// torus.
/// - Without one (a part is `free`), or closed and no ring: the tube's one radius, swept along a spline through the
///   nodes; a note says so.
/// - What makes no valid solid is left out; a note says so.
/// Equal tubes give equal bytes: the header has no time. Returns the notes, for people. The error names the file where
/// it can't be written or no tube is left for it.
Expected<std::vector<std::string>> write_step(const std::filesystem::path& path, std::span<const Tube> tubes);

}  // namespace tubetrack
