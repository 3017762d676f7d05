#pragma once

#include <cmath>
#include <vector>

#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {

/// What the image says of one short stretch of a tube's camera-facing surface, counted in pixels.
struct Station {
  double t = 0.0;         ///< middle of the stretch
  int expected = 0;       ///< pixels that should see it (incidence below 75°)
  int agree = 0;          ///< reading where the tube should be
  int before = 0;         ///< something nearer hides it
  int behind = 0;         ///< the camera looks through where the tube should be
  double flatness = 0.0;  ///< how much flatter than the circle the surface around is: 0 the circle, 1 a plane

  bool round() const { return std::abs(flatness) < 0.45; }
  bool seen() const { return expected > 0 && 2 * agree >= expected && round(); }
  bool refuted() const { return 3 * behind > expected; }
};

/// A station's length for a tube at its depth: two pixels, at least 2 mm.
double station_length_m(const HeightMap& map, const TubeModel& model);

/// Stations of about `length_m` each, in order of t, over the whole spline.
std::vector<Station> stations_of(const HeightMap& map, const TubeModel& model,
                                 const std::vector<PredictedPixel>& predicted, double length_m);

/// The stretch of the centreline that is seen: from the first to the last seen station of the run with the most of
/// them. Runs are joined across gaps that nothing refutes and that are shorter than `max_gap_m`. Empty (begin = end)
/// where none is seen.
struct Extent {
  double t_begin = 0.0;
  double t_end = 0.0;
};
Extent seen_extent(const std::vector<Station>& stations, double station_m, double max_gap_m);

/// The tightest bend of the centreline in tube radii, judged over two radii of length at a time.
double min_bend_radii(const TubeModel& model, const Extent& extent);

/// What the camera sees at and beyond one silhouette of the tube.
struct Side {
  double reach_radii = 1.0;     ///< how far from the axis the surface agrees with the circle; 1 up to the silhouette
  bool ends = false;            ///< past its reach there is background or nothing, so the reach is the true silhouette
  bool drops = false;           ///< beyond the silhouette it is deeper than the axis, or nothing returns
  bool rises = false;           ///< from the silhouette on it comes nearer: a neighbour, or the table on the near side
  double straight_share = 0.0;  ///< as Evidence::edge_share, for this side alone
};

/// Numbers that tell a tube from everything else that votes like one.
struct Evidence {
  double support = 0.0;  ///< agreeing pixels over expected ones, where it is seen
  double arc_rad = 0.0;  ///< how much of the section is seen
  double profile_rms_radii =
      0.0;  ///< mean shape of the section against the circle, pooled along the tube, RMS in radii
  double width_px = 0.0;
  double length_m = 0.0;
  double min_bend_radii = 0.0;  ///< radius of its tightest bend, in tube radii
  double sigma_m = 0.0;         ///< mean expected σ of a reading, seen straight on
  double noise_ratio = 0.0;     ///< residual RMS over its expected σ
  Side left, right;             ///< as the camera sees it
  bool stands = false;          ///< what lies beside it crosses its axis, as the ground under a standing can does
  /// Share of the length along which the surface goes straight on beyond both silhouettes, as it does from the rounded
  /// edge of a box: planes tangent to the circle and along its axis.
  double edge_share = 0.0;
  /// A tube's sides turn away from the camera, an edge's or a bulge's go on. One side is enough: the other may be
  /// hidden.
  bool turns_away() const {
    return stands || left.ends || left.drops || left.rises || right.ends || right.drops || right.rises;
  }

  double flatness = 0.0;  ///< as Station's, over all that is seen
  double flatness_sigma = 0.0;
  double taper = 0.0;  ///< change of radius per length
  double taper_sigma = 0.0;
};
Evidence gather_evidence(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                         const std::vector<PredictedPixel>& predicted, const Extent& extent);

}  // namespace tubetrack
