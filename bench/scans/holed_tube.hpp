#pragma once

#include <filesystem>
#include <string>

#include "paper_scans.hpp"
#include "tubetrack/sensors/error.hpp"

namespace tubetrack::bench {

/// A bent tube of voxels, its radius 4.9 of them, with holes: balls of `hole_voxels` radius taken out of it at random,
/// a given part of its volume in all.
PaperScan holed_tube(double part, double hole_voxels);

/// The paper's figure 2 as a table: a thinning skeleton and ours of the whole tube and of holed ones.
std::string holed_tubes_text();

/// The figure itself: the voxels, the thinning skeleton, and our centreline. The error names the file.
Expected<void> write_holed_tube_picture(const std::filesystem::path& path);

}  // namespace tubetrack::bench
