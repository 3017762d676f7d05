#pragma once

#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/stations.hpp"

namespace tubetrack {

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

  /// Two planes that meet turn by 90° or so: what is round over nearly all that faces the camera is no edge between
  /// them, and what lies beside it are neighbours that it touches.
  bool is_round() const {
    constexpr double kWholeSection_rad = 2.4;  // of the 150° that are judged
    return arc_rad > kWholeSection_rad && profile_rms_radii < 0.02;
  }

  double flatness = 0.0;  ///< as Station's, over all that is seen
  double flatness_sigma = 0.0;
  double taper = 0.0;  ///< change of radius per length
  double taper_sigma = 0.0;
};
Evidence gather_evidence(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                         const PredictedPixels& predicted, const Extent& extent);

/// The part of it that the tube's own pixels and their stations tell. Of what lies beside the tube nothing is said yet:
/// `stands`, `edge_share` and, of the sides, `drops`, `rises` and `straight_share` are as for nothing seen there.
Evidence surface_evidence(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                          const PredictedPixels& predicted, const RecycledVector<Station>& stations,
                          const Extent& extent);

/// The other part, which needs pixels of its own; left out where it is round and ends at a silhouette, as nothing that
/// lies beside it would change what it is taken for then.
void look_beside(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, const Extent& extent,
                 Evidence& evidence);

}  // namespace tubetrack
