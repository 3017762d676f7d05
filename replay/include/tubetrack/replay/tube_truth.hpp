#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// A bend as in LRA: the turn of its plane since the bend before, right-handed along the tube; 0 for the first.
struct TrueBend {
  double bend_radius_m = 0.0;
  double angle_rad = 0.0;
  double rotation_rad = 0.0;
};

/// The true course of one tube in one frame, sampled every 2 mm.
struct TrueTube {
  std::int64_t id = 0;
  double radius_m = 0.0;                      ///< where it varies: the mean over the length
  double length_m = 0.0;                      ///< of the centreline, from cap to cap
  std::vector<Eigen::Vector3d> centerline_m;  ///< in the frame that TruthFrame::frame_id names
  std::vector<double> node_radius_m = {};     ///< one a point where the radius varies, else empty
  std::vector<TrueBend> bends;                ///< along the centreline
  std::vector<bool> visible;  ///< a sample is visible when ≥ half of its camera-facing profile has returns of this tube
};

/// One line of truth.jsonl.
struct TruthFrame {
  std::int64_t frame = 0;
  double timestamp_s = 0.0;
  std::string frame_id = "camera";
  std::vector<TrueTube> tubes;
};

/// Reads a recording's truth.jsonl; the error names the line.
Expected<std::vector<TruthFrame>> read_truth(const std::filesystem::path& path);

/// One line of truth.jsonl, without the line's end. Points are rounded to 1 µm.
std::string truth_json(const TruthFrame& truth);

}  // namespace tubetrack
