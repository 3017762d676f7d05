#pragma once

#include <cstddef>
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
  std::size_t level = 0;  ///< the grid that it was fitted to last, find_scan_tubes' numbers
};

/// Surfels to fit to, and those among them that belong to another tube.
struct ScanSurface {
  const SurfelGrid& grid;
  std::span<const char> taken;  ///< one flag a surfel, or empty
  double spacing_m = 0.0;       ///< how far apart surfels are
};

/// A tube of another octave's radii is found by that one's own votes, which lead along all of it.
bool is_of_octave(double radius_m, const Octave& octave, const ScanTubesConfig& config);

/// A fit of the surface around a seed: gives the seed its radius, and says whether it is certain. False where
/// there is no tube, or none of the octave.
bool fit_seed(const ScanSurface& surface, const Octave& octave, const ScanTubesConfig& config, ScanSeed& seed);

/// From a seed, whose radius has been fitted, to a tube: fit, cut off what no surfel bears out, go on at both ends
/// while surfels do; a line whose ends meet is closed. Nothing where there is no tube.
std::optional<ScanTube> grow_scan_tube(const ScanSurface& surface, const ScanSeed& seed, const ScanTubesConfig& config);

/// The last fit of a tube, with covariance; to another set of surfels than it was `fitted` to, from the beginning.
/// False where it is no tube there.
bool refine_scan_tube(const ScanSurface& surface, const ScanTubesConfig& config, bool fitted, ScanTube& tube);

/// The tube that two are pieces of: where an end of one runs on into an end of the other, and one fit of both, on
/// surfels that neither has taken, is as long as the two. Nothing where they are not one.
std::optional<ScanTube> join_scan_tubes(const ScanSurface& surface, const ScanTubesConfig& config, const ScanTube& a,
                                        const ScanTube& b);

}  // namespace tubetrack
