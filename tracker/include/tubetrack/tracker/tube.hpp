#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace tubetrack {

enum class TubeState { tracked, occluded, lost };

/// A straight or toric part of a tube, from and to in metres of arc length along the centreline.
struct Segment {
  enum class Type { straight, arc, free };
  Type type = Type::straight;
  double from_m = 0.0;
  double to_m = 0.0;
  double bend_radius_m = 0.0;   ///< arcs only
  double bend_angle_rad = 0.0;  ///< arcs only
};

/// A row of LRA: a bend with the straight before it, or the closing straight alone (angle 0). σ's are standard
/// deviations.
struct BendRow {
  double length_m = 0.0;      ///< of the straight
  double rotation_rad = 0.0;  ///< turn of the bend's plane about that straight since the bend before, right-handed
                              ///< along the tube, in (−π, π]; 0 for the first
  double angle_rad = 0.0;
  double bend_radius_m = 0.0;  ///< of the centreline
  double length_sigma_m = 0.0;
  double rotation_sigma_rad = 0.0;
  double angle_sigma_rad = 0.0;
  double bend_radius_sigma_m = 0.0;
  bool ill_conditioned = false;  ///< bend_table.hpp says when
};

/// The tables of tube bending. Empty where the tube has a `free` part or none were found.
struct BendTable {
  std::vector<Eigen::Vector3d> xyz_m;  ///< the tube's ends, and between them where each bend's straights intersect; a
                                       ///< bend above 150° counts as two halves
  std::vector<BendRow> lra;            ///< one a bend, and the closing length
};

/// One tube of one frame. Points are in the frame that TubeFrame::frame_id names; all vectors have one entry a node.
struct Tube {
  std::int64_t id = 0;
  TubeState state = TubeState::tracked;
  double radius_m = 0.0;
  double radius_sigma_m = 0.0;
  double length_m = 0.0;
  /// 0…1: the part of the tube's camera-facing surface that the frame confirms, times the chance that it tapers by less
  /// than 5 %; 0 while it is out of sight.
  double confidence = 0.0;
  std::vector<Eigen::Vector3d> centerline_m;
  std::vector<double> sigma_m;  ///< the larger axis across the tube
  std::vector<Eigen::Matrix3d> node_covariance_m2;
  std::vector<bool> node_visible;
  std::vector<double> node_radius_m;        ///< tubes of varying radius only; empty: radius_m everywhere
  std::vector<double> node_radius_sigma_m;  ///< the same; empty also where it is not known
  std::vector<Segment> segments;
  BendTable bend_table;
  bool closed = false;  ///< a ring, of a scan: its last node is its first
};

enum class TrackStatus { ok, empty, corrupt, no_pose, deadline };

/// Milliseconds a stage took.
struct StageTimes {
  double update_ms = 0.0;
  double normals_ms = 0.0;
  double accumulate_ms = 0.0;
  double trace_ms = 0.0;
  double fit_ms = 0.0;
  double segment_ms = 0.0;
};

/// Everything known after one frame.
struct TubeFrame {
  std::int64_t frame = 0;
  double timestamp_s = 0.0;
  std::string frame_id = "camera";  ///< camera, world or scan
  TrackStatus status = TrackStatus::ok;
  std::string problem;  ///< why status is not ok, for people
  std::int64_t dropped = 0;
  double latency_ms = 0.0;
  StageTimes stages;
  std::vector<Tube> tubes;
};

}  // namespace tubetrack
