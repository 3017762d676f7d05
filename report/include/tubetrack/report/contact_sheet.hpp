#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

struct LabelledPicture {
  std::filesystem::path path;
  std::string label;
};

/// Tiles pictures row by row into one PNG, each shrunk to tile_width_px with its label on it. All take the shape of the
/// first; greys are made a little coarser so that the file stays small.
Expected<void> write_contact_sheet(const std::filesystem::path& path, std::span<const LabelledPicture> pictures,
                                   int columns, int tile_width_px);

}  // namespace tubetrack
