#include "tubetrack/report/score.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "tubetrack/report/calibration.hpp"
#include "tubetrack/report/summary.hpp"

namespace tubetrack {

namespace {

constexpr double kUndefined = std::numeric_limits<double>::quiet_NaN();

double quotient(double part, double whole) {
  return whole > 0.0 ? part / whole : kUndefined;
}

/// What one reported tube has to do with each true tube of its frame.
struct ReportedTube {
  std::int64_t id = 0;
  double length_m = 0.0;
  std::vector<double> on_true_m;  ///< length that is nearest to, and within reach of, true tube i
};

/// All that is carried from frame to frame.
struct Tally {
  std::map<std::int64_t, TubeScore> tubes;
  TubeScore total;
  std::map<std::int64_t, std::int64_t> last_reported;                  ///< by true id
  std::map<std::int64_t, std::int64_t> last_true;                      ///< by reported id
  std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> hits;  ///< by (true id, reported id): frames
  std::map<std::int64_t, std::int64_t> reported_frames;                ///< by reported id
};

void add_coverage(const TruthFrame& truth, const TubeFrame& result, const ScoreRules& rules, Tally& tally) {
  for (const TrueTube& tube : truth.tubes) {
    TubeScore& score = tally.tubes[tube.id];
    const double reach_m = rules.covered_within_radii * tube.radius_m;
    for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) {
      if (i < tube.visible.size() && !tube.visible[i]) continue;
      ++score.visible_samples;
      const bool covered = std::any_of(result.tubes.begin(), result.tubes.end(), [&](const Tube& reported) {
        return foot_on_line(tube.centerline_m[i], reported.centerline_m).distance_m <= reach_m;
      });
      score.covered_samples += covered ? 1 : 0;
    }
  }
}

/// Adds false length, RMS and lengths; returns what the matching needs. A sample belongs to the true tube that is
/// nearest in radii; without any true tube it is false and belongs to the total alone.
ReportedTube add_reported(const TruthFrame& truth, const Tube& reported, const ScoreRules& rules, Tally& tally) {
  ReportedTube overlap{reported.id, 0.0, std::vector<double>(truth.tubes.size(), 0.0)};
  const LineSamples samples = resample(reported.centerline_m, rules.sample_step_m);
  for (const Eigen::Vector3d& point : samples.points) {
    double nearest_radii = std::numeric_limits<double>::infinity();
    std::size_t nearest = 0;
    LineFoot foot;
    for (std::size_t i = 0; i < truth.tubes.size(); ++i) {
      const LineFoot candidate = foot_on_line(point, truth.tubes[i].centerline_m);
      if (candidate.distance_m / truth.tubes[i].radius_m >= nearest_radii) continue;
      nearest_radii = candidate.distance_m / truth.tubes[i].radius_m;
      nearest = i;
      foot = candidate;
    }
    overlap.length_m += samples.piece_m;
    TubeScore& score = std::isfinite(nearest_radii) ? tally.tubes[truth.tubes[nearest].id] : tally.total;
    score.reported_m += samples.piece_m;
    if (nearest_radii > rules.false_beyond_radii) {
      score.false_m += samples.piece_m;
      continue;
    }
    overlap.on_true_m[nearest] += samples.piece_m;
    if (foot.beyond_end) continue;
    score.squared_error_m2 += foot.distance_m * foot.distance_m;
    ++score.matched_samples;
  }
  return overlap;
}

/// True tube by reported tube, one to one, by the longest common length; a reported line with less than half of its
/// length on a true tube is not that tube.
std::vector<int> match(const TruthFrame& truth, const std::vector<ReportedTube>& reported) {
  std::vector<double> gain(truth.tubes.size() * reported.size(), 0.0);
  for (std::size_t i = 0; i < truth.tubes.size(); ++i) {
    for (std::size_t j = 0; j < reported.size(); ++j) {
      const double common_m = reported[j].on_true_m[i];
      if (common_m >= 0.5 * reported[j].length_m) gain[i * reported.size() + j] = common_m;
    }
  }
  return best_assignment(gain, static_cast<int>(truth.tubes.size()), static_cast<int>(reported.size()));
}

bool required(const TrueTube& tube, const ScoreRules& rules) {
  std::size_t visible =
      tube.visible.size() < tube.centerline_m.size() ? tube.centerline_m.size() - tube.visible.size() : 0;
  visible += static_cast<std::size_t>(std::count(tube.visible.begin(), tube.visible.end(), true));
  // The truth's own samples are 2 mm apart by its definition.
  return static_cast<double>(visible) * 0.002 >=
         std::max(rules.required_length_radii * tube.radius_m, rules.required_length_m);
}

void add_identity(const TruthFrame& truth, const TubeFrame& result, const std::vector<ReportedTube>& reported,
                  const ScoreRules& rules, Tally& tally) {
  const std::vector<int> matched = match(truth, reported);
  for (const ReportedTube& tube : reported) ++tally.reported_frames[tube.id];
  for (std::size_t i = 0; i < truth.tubes.size(); ++i) {
    const TrueTube& tube = truth.tubes[i];
    TubeScore& score = tally.tubes[tube.id];
    if (matched[i] < 0) {
      score.frames_in_view += required(tube, rules) ? 1 : 0;
      continue;
    }
    ++score.frames_in_view;
    ++score.frames_found;
    const Tube& found = result.tubes[static_cast<std::size_t>(matched[i])];
    score.radius_errors.push_back(std::abs(found.radius_m - tube.radius_m) / tube.radius_m);
    ++tally.hits[{tube.id, found.id}];
    const auto [reported_id, first_time] = tally.last_reported.try_emplace(tube.id, found.id);
    if (!first_time && std::exchange(reported_id->second, found.id) != found.id) ++score.switches;
    const auto [true_id, first_use] = tally.last_true.try_emplace(found.id, tube.id);
    if (!first_use && std::exchange(true_id->second, tube.id) != tube.id) ++score.transfers;
  }
}

void add_intervals(const TruthFrame& truth, const TubeFrame& result, const ScoreRules& rules, Tally& tally) {
  Calibration calibration;
  add_frame(calibration, truth, result, Eigen::Isometry3d::Identity(), rules);
  for (const NodeError& node : calibration.nodes) {
    TubeScore& score = tally.tubes[node.true_id];
    ++score.interval_nodes;
    score.interval_hits += node.inside() ? 1 : 0;
  }
}

/// A lost tube is remembered, not reported: where it is said to be is where it was.
TubeFrame without_lost(TubeFrame result) {
  std::erase_if(result.tubes, [](const Tube& tube) { return tube.state == TubeState::lost; });
  return result;
}

/// IDF1's identities: one reported id a true tube, for the whole run, with the most frames in common.
void assign_identities(Tally& tally) {
  std::vector<std::int64_t> true_ids, reported_ids;
  for (const auto& [id, score] : tally.tubes) true_ids.push_back(id);
  for (const auto& [id, frames] : tally.reported_frames) reported_ids.push_back(id);
  std::vector<double> gain(true_ids.size() * reported_ids.size(), 0.0);
  for (std::size_t i = 0; i < true_ids.size(); ++i) {
    for (std::size_t j = 0; j < reported_ids.size(); ++j) {
      const auto hit = tally.hits.find({true_ids[i], reported_ids[j]});
      if (hit != tally.hits.end()) gain[i * reported_ids.size() + j] = static_cast<double>(hit->second);
    }
  }
  const auto assigned = best_assignment(gain, static_cast<int>(true_ids.size()), static_cast<int>(reported_ids.size()));
  for (std::size_t i = 0; i < true_ids.size(); ++i) {
    if (assigned[i] < 0) continue;
    const std::int64_t reported_id = reported_ids[static_cast<std::size_t>(assigned[i])];
    TubeScore& score = tally.tubes[true_ids[i]];
    score.identity_hits = tally.hits.at({true_ids[i], reported_id});
    score.reported_tubes = tally.reported_frames.at(reported_id);
  }
}

void pool(Tally& tally) {
  TubeScore& total = tally.total;
  for (const auto& [id, tube] : tally.tubes) {
    total.frames_in_view += tube.frames_in_view;
    total.frames_found += tube.frames_found;
    total.visible_samples += tube.visible_samples;
    total.covered_samples += tube.covered_samples;
    total.reported_m += tube.reported_m;
    total.false_m += tube.false_m;
    total.squared_error_m2 += tube.squared_error_m2;
    total.matched_samples += tube.matched_samples;
    total.interval_nodes += tube.interval_nodes;
    total.interval_hits += tube.interval_hits;
    total.radius_errors.insert(total.radius_errors.end(), tube.radius_errors.begin(), tube.radius_errors.end());
    total.identity_hits += tube.identity_hits;
    total.switches += tube.switches;
    total.transfers += tube.transfers;
  }
  for (const auto& [id, frames] : tally.reported_frames) total.reported_tubes += frames;
}

}  // namespace

double median(std::vector<double> values) {
  if (values.empty()) return kUndefined;
  std::sort(values.begin(), values.end());
  return 0.5 * (values[values.size() / 2] + values[(values.size() - 1) / 2]);
}

double TubeScore::coverage() const {
  return quotient(static_cast<double>(covered_samples), static_cast<double>(visible_samples));
}
double TubeScore::false_length() const {
  return quotient(false_m, reported_m);
}
double TubeScore::rms_m() const {
  return std::sqrt(quotient(squared_error_m2, static_cast<double>(matched_samples)));
}
double TubeScore::radius_error_median() const {
  return median(radius_errors);
}
double TubeScore::inside_95() const {
  return quotient(static_cast<double>(interval_hits), static_cast<double>(interval_nodes));
}
double TubeScore::idf1() const {
  return quotient(2.0 * static_cast<double>(identity_hits), static_cast<double>(frames_in_view + reported_tubes));
}

Expected<Score> score_run(std::span<const TruthFrame> truth, std::span<const TubeFrame> results,
                          const ScoreRules& rules) {
  std::map<std::int64_t, const TubeFrame*> result_of;
  for (const TubeFrame& result : results) result_of[result.frame] = &result;
  Score score;
  Tally tally;
  for (const TruthFrame& frame : truth) {
    const auto found = result_of.find(frame.frame);
    const TubeFrame* result = found == result_of.end() ? nullptr : found->second;
    if (result != nullptr) result_of.erase(found);
    if (frame.frame < rules.first_frame) continue;
    if (result == nullptr) {
      ++score.frames_not_run;
      continue;
    }
    if (is_bad(result->status)) {
      ++score.frames_bad;
      continue;
    }
    const TubeFrame reported_now = without_lost(*result);
    if (!reported_now.tubes.empty() && reported_now.frame_id != frame.frame_id) {
      return tl::make_unexpected(Error::failed(fmt::format(
          "frame {}: the truth is in the {} frame, the result in the {} frame; give the results of this recording",
          frame.frame, frame.frame_id, reported_now.frame_id)));
    }
    ++score.frames_scored;
    add_coverage(frame, reported_now, rules, tally);
    std::vector<ReportedTube> reported;
    reported.reserve(reported_now.tubes.size());
    for (const Tube& tube : reported_now.tubes) reported.push_back(add_reported(frame, tube, rules, tally));
    add_identity(frame, reported_now, reported, rules, tally);
    add_intervals(frame, reported_now, rules, tally);
    add(score.bends, bend_errors(frame, reported_now));
    for (const TrueTube& tube : frame.tubes) tally.tubes[tube.id].true_radius_m = tube.radius_m;
  }
  for (const auto& [number, result] : result_of) score.frames_without_truth += number >= rules.first_frame ? 1 : 0;
  if (score.frames_scored + score.frames_bad == 0) {
    return tl::make_unexpected(Error::failed(
        fmt::format("no frame to score: {} frames of truth, {} of results, none with the same number{}", truth.size(),
                    results.size(), rules.first_frame > 0 ? " from the first one scored on" : "")));
  }
  assign_identities(tally);
  pool(tally);
  for (auto& [id, tube] : tally.tubes) {
    tube.id = id;
    score.tubes.push_back(std::move(tube));
  }
  score.total = std::move(tally.total);
  return score;
}

}  // namespace tubetrack
