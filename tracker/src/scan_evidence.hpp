#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scan_fit.hpp"
#include "tubetrack/tracker/scan_tubes.hpp"

namespace tubetrack {

/// A section seen over more than this is seen from all sides.
constexpr double kAllAround_rad = 4.2;

/// What the surfels say of a stretch of a tube, about half a radius long.
struct ScanStation {
  double t = 0.0;         ///< its middle
  double agree = 0.0;     ///< weight of the surfels on the tube's surface, their normals along its own
  double facing = 0.0;    ///< weight of all that points_near gives
  double radius_m = 0.0;  ///< mean distance of those that agree; 0 where none does
  double arc_rad = 0.0;  ///< how much of the section is seen, by places and by normals, here and in the stations beside
  bool seen = false;     ///< arc_rad suffices
};

struct ScanEvidence {
  std::vector<ScanStation> stations;  ///< over the whole line, in order
  double t_begin = 0.0, t_end = 0.0;  ///< the seen stretch, joined across gaps of 3 radii; empty where none is seen
  double begin_sigma_m = 0.0, end_sigma_m = 0.0;  ///< of the stretch's ends, along the line
  double length_m = 0.0;
  double arc_rad = 0.0;            ///< median over the stations of the stretch
  double support = 0.0;            ///< agreeing weight over facing weight
  double profile_rms_radii = 0.0;  ///< of the section's shape against the circle, pooled along the stretch
  double spacing_radii = 0.0;      ///< how far apart the surfels are
  double scale_radii = 0.0;        ///< how much they scatter
  double taper = 0.0;              ///< change of radius per length
};

/// `points`: of every so many surfels; `spacing_m`: how far apart the surfels are; `scale_m`: how much they err.
ScanEvidence look_at(std::span<const CellSurfel> surfels, const std::vector<SurfacePoint>& points, std::size_t every,
                     const ScanLine& line, double spacing_m, double scale_m, double min_arc_rad);

/// The ends of the seen stretch once more, by all surfels of the scan near them: the mean of a cell does not tell where
/// in it the surface ends. Arguments as `look_at`'s, which made the evidence.
void look_at_ends(std::span<const ScanSurfel> surfels, const ScanLine& line, double spacing_m, double scale_m,
                  double min_arc_rad, ScanEvidence& evidence);

/// Beyond doubt: nearly all that is near agrees, and closely. The surfels of such a tube are not looked at again for
/// other radii.
bool is_certain(const ScanEvidence& evidence);

/// DESIGN section 2, "A tube": long, round and enough of it seen. The reason when it is none.
std::optional<std::string> why_no_scan_tube(const ScanEvidence& evidence, double radius_m,
                                            const ScanTubesConfig& config);

}  // namespace tubetrack
