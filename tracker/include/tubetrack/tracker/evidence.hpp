#pragma once

#include <vector>

#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {

/// What the image says of one short stretch of a tube's camera-facing surface, counted in pixels.
struct Station {
  double t = 0.0;    ///< middle of the stretch
  int expected = 0;  ///< pixels that should see it (incidence below 75°)
  int agree = 0;     ///< reading where the tube should be
  int before = 0;    ///< something nearer hides it
  int behind = 0;    ///< the camera looks through where the tube should be

  bool seen() const { return expected > 0 && 2 * agree >= expected; }
  bool refuted() const { return 3 * behind > expected; }
};

/// A station's length for a tube at its depth: two pixels, at least 2 mm.
double station_length_m(const HeightMap& map, const TubeModel& model);

/// Stations of about `length_m` each, in order of t, over the whole spline.
std::vector<Station> stations_of(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                                 const std::vector<PredictedPixel>& predicted, double length_m);

/// The stretch of the centreline that is seen: from the first to the last seen station of the run with the most of
/// them. Runs are joined across gaps that nothing refutes and that are shorter than `max_gap_m`. Empty (begin = end)
/// where none is seen.
struct Extent {
  double t_begin = 0.0;
  double t_end = 0.0;
};
Extent seen_extent(const std::vector<Station>& stations, double station_m, double max_gap_m);

/// Numbers that tell a tube from everything else that votes like one.
struct Evidence {
  double support = 0.0;         ///< agreeing pixels over expected ones
  double arc_rad = 0.0;         ///< how much of the section is seen
  double profile_rms_radii = 0.0;  ///< mean shape of the section against the circle, pooled along the tube, RMS in radii
  double width_px = 0.0;
  double length_m = 0.0;
  double noise_ratio = 0.0;     ///< residual RMS over its expected σ
};
Evidence gather_evidence(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                         const std::vector<PredictedPixel>& predicted, const Extent& extent);

}  // namespace tubetrack
