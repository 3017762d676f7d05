#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "nominal_check.hpp"
#include "scan_outputs.hpp"
#include "tubetrack/replay/scan_surfels.hpp"
#include "tubetrack/tracker/scan_tubes.hpp"

namespace tubetrack {

/// The flags of `tubetrack scan` as they were typed; empty: not given.
struct ScanFlags {
  std::string file;
  std::string unit, grid_step, radius, radius_range, label, threshold, cell_size, height_scale;
  std::string normals, out;
  NominalFlags nominal;
  ScanOutputs outputs;
  bool no_timing = false, quiet = false;
};
void add_scan_flags(CLI::App& command, ScanFlags& flags);

// What the flags say. The error is of usage; it names the flag, what it got and what it takes.

Expected<ScanOptions> scan_options_from(const ScanFlags& flags);
/// --radius and --radius-range, into `config`.
Expected<void> apply_radius(const ScanFlags& flags, ScanTubesConfig& config);
Expected<std::optional<double>> grid_step_from(const ScanFlags& flags);
Expected<GridNormals> normals_from(const ScanFlags& flags);

/// An error where a flag was given that says nothing about this kind of scan.
Expected<void> check_flags_fit(const ScanFlags& flags, ScanKind kind);

/// An error where a length was given that is larger than the scan: most likely in millimetres.
Expected<void> check_lengths_fit(const ScanFlags& flags, const ScanTubesConfig& config,
                                 std::span<const ScanSurfel> surfels);

/// mesh, point cloud, voxels, height map.
std::string_view name_of(ScanKind kind);

}  // namespace tubetrack
