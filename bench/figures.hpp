#pragma once

#include <cstdint>
#include <vector>

#include "tubetrack/report/bend_errors.hpp"
#include "tubetrack/report/calibration.hpp"
#include "tubetrack/report/cramer_rao.hpp"
#include "tubetrack/report/score.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack::bench {

/// What some frames of one row gave, pooled.
struct Figures {
  std::int64_t frames = 0;
  std::int64_t reported_tubes = 0;
  TubeScore score;  ///< all tubes of all scenes
  Calibration calibration;
  std::vector<double> sigma_over_bound;         ///< one a visible node: reported σ over the Cramér-Rao bound
  std::vector<double> bound_rms_m;              ///< one a visible node: the bound on the distance to the truth
  std::vector<double> radius_sigma_over_bound;  ///< one a true tube reported
  std::vector<double> radius_bound_m;           ///< one a true tube reported
  BendErrors bends;
  std::vector<double> frame_ms;
  std::vector<StageTimes> stages;
};

void add(Figures& sum, const Figures& part);

/// A quantile of a copy, 0 ≤ part ≤ 1; NaN of nothing.
double quantile(std::vector<double> values, double part);
double mean(const std::vector<double>& values);
double root_mean_square(const std::vector<double>& values);
StageTimes median_stages(const std::vector<StageTimes>& stages);

/// |reported − true| of the true tubes' radii, in metres and as a part of the radius.
std::vector<double> radius_errors_m(const Calibration& calibration);
std::vector<double> radius_errors_relative(const Calibration& calibration);

/// Nodes and tubes within [from, to) of something, for the tables by depth and by radius.
Calibration by_depth(const Calibration& calibration, double from_m, double to_m);
Calibration by_radius(const Calibration& calibration, double from_m, double to_m);

}  // namespace tubetrack::bench
