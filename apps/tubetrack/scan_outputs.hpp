#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string>
#include <string_view>

#include "tubetrack/replay/scan_surfels.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// Files that `tubetrack scan` writes besides its line; empty: not asked for.
struct ScanOutputs {
  std::string centerline, xyz, lra, vtk, mesh, step, error_map, picture;
};
void add_scan_output_flags(CLI::App& command, ScanOutputs& outputs);

/// Before any work: names with the extension that the flag takes, in existing folders, none twice and none the input;
/// and --step only where this tubetrack can write it, else the error names the package.
/// `out` is where the JSON line goes, empty: stdout.
Expected<void> check_scan_outputs(const ScanOutputs& outputs, const std::string& out, const std::string& input,
                                  const std::string& nominal);

/// Tubes and scan in metres, the scan in the file's frame: `scan.origin_m` and `scan.pose` take it to the tubes'. The
/// summary of the error map and notes on what STEP lacks go to stderr. The error names the flag or the file.
Expected<void> write_scan_outputs(const ScanOutputs& outputs, const Scan& scan, std::span<const ScanSurfel> surfels,
                                  std::span<const Tube> tubes);

/// `text` to the file that `flag` names.
Expected<void> write_text_file(std::string_view flag, const std::string& path, const std::string& text);

}  // namespace tubetrack
