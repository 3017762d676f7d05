#pragma once

#include "tubetrack/tracker/follow.hpp"
#include "tubetrack/tracker/segments.hpp"

namespace tubetrack {

/// One σ, of the radius: no tube is rounder.
constexpr double kRoundness = 3e-4;

/// A followed tube as a result: nodes about half a radius apart along its extent, in the camera frame.
/// Writes over the last frame's result, whose memory is used again.
void set_result(const FollowedTube& followed, const HeightMap& map, Tube& tube);

double polyline_length_m(const std::vector<Eigen::Vector3d>& line_m);

/// Adds a node's uncertainty at `t` to the tube: its covariance from that of the control points (as in FitQuality), and
/// the larger σ across the tube.
void add_uncertainty(const Spline& spline, const RecycledMatrix& covariance, double t, Tube& tube);
/// The same from the covariance of the place itself.
void add_place_uncertainty(const Spline& spline, Eigen::Matrix3d covariance_m2, double t, Tube& tube);

/// Fills in `segments` and `bend_table` from the centreline (paper, section 3).
void add_parts(Tube& tube);
void set_parts(const CenterlineParts& parts, Tube& tube);

/// Adds to the uncertainty of a tube out of sight what it may have moved by since, in any direction: while hidden it is
/// predicted, not seen.
void add_unseen_motion(Tube& tube, const FollowedTube& followed, double timestamp_s);

/// Adds to the uncertainty what is common to all of a tube and to every frame (NoiseModel::radius_relative): its
/// surface is seen, so an axis is as much too far as the radius is too large. After `add_parts`, as bends don't feel
/// it; in the camera frame.
void add_common_error(Tube& tube, double radius_relative);

/// The same in the world frame.
void move_to_world(Tube& tube, const Eigen::Isometry3d& world_from_camera);

}  // namespace tubetrack
