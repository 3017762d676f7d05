#pragma once

#include <cmath>

#include "tubetrack/tracker/predict.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// What the image says of one short stretch of a tube's camera-facing surface, counted in pixels.
struct Station {
  double t = 0.0;         ///< middle of the stretch
  int expected = 0;       ///< pixels that should see it (incidence below 75°)
  int agree = 0;          ///< reading where the tube should be
  int before = 0;         ///< something nearer hides it
  int anothers = 0;       ///< of those: they see another known tube, which hides it
  int behind = 0;         ///< the camera looks through where the tube should be
  double flatness = 0.0;  ///< how much flatter than the circle the surface around is: 0 the circle, 1 a plane

  bool round() const { return std::abs(flatness) < 0.45; }
  /// Where another tube has most of it, what is left says too little.
  bool seen() const {
    const int own = expected - anothers;
    return 3 * own > expected && 2 * agree >= own && round();
  }
  bool refuted() const { return 3 * behind > expected; }
};

/// A station's length for a tube at its depth: two pixels, at least 2 mm.
double station_length_m(const HeightMap& map, const TubeModel& model);

/// Stations of about `length_m` each, in order of t, over the whole spline.
RecycledVector<Station> stations_of(const HeightMap& map, const TubeModel& model, const PredictedPixels& predicted,
                                    double length_m);

/// The stretch of the centreline that is seen: from the first to the last seen station of the run with the most of
/// them. Runs are joined across gaps that nothing refutes and that are shorter than `max_gap_m`. Empty (begin = end)
/// where none is seen.
Extent seen_extent(const RecycledVector<Station>& stations, double station_m, double max_gap_m);

}  // namespace tubetrack
