#pragma once

#include <filesystem>
#include <span>

#include "tubetrack/report/surface_mesh.hpp"

namespace tubetrack {

/// Renders surfaces side by side, each in its colours (grey without), from where they are seen broadest, all from the
/// same side and at one scale; in software, without a display. Writes a PNG of 800 pixels a surface in height and
/// width. Points without faces are drawn as dots. The error names the file.
Expected<void> write_scan_picture(const std::filesystem::path& path, std::span<const SurfaceMesh> surfaces);

}  // namespace tubetrack
