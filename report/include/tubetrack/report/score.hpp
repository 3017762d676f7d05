#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tubetrack/replay/tube_truth.hpp"
#include "tubetrack/report/bend_errors.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// The thresholds of the score (DESIGN §5).
struct ScoreRules {
  double covered_within_radii = 0.35;  ///< a visible truth sample with a reported line this near is covered
  double false_beyond_radii = 1.0;     ///< reported line farther than this from every true axis is false
  double sample_step_m = 0.002;        ///< reported lines are resampled at this step
  /// A true tube with less in view need not be found: it counts for identity only where it was found.
  double required_length_radii = 1.5;
  double required_length_m = 0.020;
  std::int64_t first_frame = 0;  ///< earlier frames are not scored (a tracker may need some to settle)
};

/// The score of one true tube over all frames, or of all tubes pooled (id −1). A quotient without a denominator is NaN.
struct TubeScore {
  std::int64_t id = -1;
  double true_radius_m = 0.0;       ///< 0 in the pooled score
  std::int64_t frames_in_view = 0;  ///< frames in which the tube had to be found, or was
  std::int64_t frames_found = 0;
  std::int64_t visible_samples = 0;
  std::int64_t covered_samples = 0;
  /// Reported line that has this tube as its nearest (by distance over radius), and the part of it that is false.
  double reported_m = 0.0;
  double false_m = 0.0;
  /// Over reported samples that are not false and whose foot is on the true axis, not beyond its ends.
  double squared_error_m2 = 0.0;
  std::int64_t matched_samples = 0;
  std::vector<double> radius_errors;  ///< |reported − true| / true, one a frame found
  /// Visible nodes matched with this tube, and those whose reported 95 % interval holds the truth (calibration.hpp).
  std::int64_t interval_nodes = 0;
  std::int64_t interval_hits = 0;
  /// Identity, on pairs of a true and a reported tube matched frame by frame.
  std::int64_t reported_tubes =
      0;  ///< reported tubes, frame by frame, of the identity assigned to this tube; pooled: all
  std::int64_t identity_hits = 0;  ///< frames in which this tube was found under its assigned identity
  std::int64_t switches = 0;       ///< a true tube is found under another reported id than the last time
  std::int64_t transfers = 0;      ///< a reported id is found on another true tube than the last time

  double coverage() const;
  double false_length() const;
  double rms_m() const;
  double radius_error_median() const;
  double inside_95() const;
  double idf1() const;
};

struct Score {
  std::vector<TubeScore> tubes;  ///< by id
  TubeScore total;
  BendErrors bends;  ///< of all frames scored
  std::int64_t frames_scored = 0;
  std::int64_t frames_bad = 0;      ///< corrupt, no_pose: not scored
  std::int64_t frames_not_run = 0;  ///< truth without a result (dropped, or outside --frames): not scored
  std::int64_t frames_without_truth = 0;
};

/// Compares a run with the truth, joined by frame number. Tracked and occluded tubes are reported; lost ones are not.
/// The error says where the two can't be compared: no frame in
/// common, or in different coordinate frames.
Expected<Score> score_run(std::span<const TruthFrame> truth, std::span<const TubeFrame> results,
                          const ScoreRules& rules);

/// A table for people, one row a tube and one for all.
std::string score_table(const Score& score);
/// The same as one JSON object, keys with units, lengths in metres, parts as fractions; what is undefined is null.
std::string score_json(const Score& score);

/// NaN of nothing; of an even number the mean of the two in the middle.
double median(std::vector<double> values);

/// The nearest point of a polyline.
struct LineFoot {
  double distance_m = 0.0;
  bool beyond_end = false;  ///< the foot is an end of the line, and the point lies past it
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();  ///< the line's unit direction there
  double from_start_m = 0.0;                         ///< length of the line up to there
};
/// A line of one point is that point; of none, at infinite distance.
LineFoot foot_on_line(const Eigen::Vector3d& point, std::span<const Eigen::Vector3d> line);

/// Mid-points of equal pieces of at most `step_m`, and the length each stands for.
struct LineSamples {
  std::vector<Eigen::Vector3d> points;
  double piece_m = 0.0;
};
LineSamples resample(std::span<const Eigen::Vector3d> line, double step_m);

/// The one-to-one assignment of rows to columns with the largest sum; −1: row left free. `gain` is row-major, ≥ 0.
std::vector<int> best_assignment(const std::vector<double>& gain, int rows, int cols);

}  // namespace tubetrack
