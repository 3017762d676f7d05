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
std::optional<ScanTube> grow_scan_tube(const ScanSurface& surface, const ScanSeed& seed, const ScanTubesConfig& config);

/// Fits a tube to another, finer set of surfels. False where it is no tube there.
bool refine_scan_tube(const ScanSurface& surface, const ScanTubesConfig& config, ScanTube& tube);

/// The tube that two are pieces of: where an end of one runs on into an end of the other, and one fit of both, on
/// surfels that neither has taken, is as long as the two. Nothing where they are not one.
std::optional<ScanTube> join_scan_tubes(const ScanSurface& surface, const ScanTubesConfig& config, const ScanTube& a,
                                        const ScanTube& b);

}  // namespace tubetrack
