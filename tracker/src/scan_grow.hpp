#pragma once

#include <optional>
#include <span>
#include <vector>

#include "scan_evidence.hpp"
#include "scan_votes.hpp"

namespace tubetrack {

/// A tube of a scan with what speaks for it.
struct ScanTube {
  ScanLine line;
  ScanFit fit;
  ScanEvidence evidence;
};

/// Surfels to fit to, and those among them that belong to another tube.
struct ScanSurface {
  std::span<const Surfel> surfels;
  std::span<const char> taken;  ///< one flag a surfel, or empty
  double spacing_m = 0.0;
};

/// From a seed to a fitted tube: fit, cut off what no surfel bears out, go on at both ends while surfels do; a line
/// whose ends meet is closed. Nothing where there is no tube.
std::optional<ScanTube> grow_scan_tube(const ScanSurface& surface, const ScanSeed& seed,
                                       const ScanTubesConfig& config);

/// Fits a tube to another, finer set of surfels. False where it is no tube there.
bool refine_scan_tube(const ScanSurface& surface, const ScanTubesConfig& config, ScanTube& tube);

}  // namespace tubetrack
