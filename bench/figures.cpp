#include "figures.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

namespace tubetrack::bench {

namespace {

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

void add(TubeScore& sum, const TubeScore& part) {
  sum.frames_in_view += part.frames_in_view;
  sum.frames_found += part.frames_found;
  sum.visible_samples += part.visible_samples;
  sum.covered_samples += part.covered_samples;
  sum.reported_m += part.reported_m;
  sum.false_m += part.false_m;
  sum.squared_error_m2 += part.squared_error_m2;
  sum.matched_samples += part.matched_samples;
  sum.interval_nodes += part.interval_nodes;
  sum.interval_hits += part.interval_hits;
  append(sum.radius_errors, part.radius_errors);
  sum.reported_tubes += part.reported_tubes;
  sum.identity_hits += part.identity_hits;
  sum.switches += part.switches;
  sum.transfers += part.transfers;
}

template <class Value>
double median_of(const std::vector<StageTimes>& stages, Value value) {
  std::vector<double> values;
  std::ranges::transform(stages, std::back_inserter(values), value);
  return median(std::move(values));
}

template <class OfNode, class OfTube>
Calibration within(const Calibration& all, double from, double to, OfNode of_node, OfTube of_tube) {
  const auto inside = [&](double value) { return value >= from && value < to; };
  Calibration some;
  bool first = false;
  for (const NodeError& node : all.nodes) {
    first = first || node.first;
    if (!inside(of_node(node))) continue;
    some.nodes.push_back(node);
    some.nodes.back().first = std::exchange(first, false);
  }
  std::ranges::copy_if(all.tubes, std::back_inserter(some.tubes),
                       [&](const TubeError& t) { return inside(of_tube(t)); });
  return some;
}

}  // namespace

void add(Figures& sum, const Figures& part) {
  sum.frames += part.frames;
  sum.reported_tubes += part.reported_tubes;
  add(sum.score, part.score);
  append(sum.calibration.nodes, part.calibration.nodes);
  append(sum.calibration.tubes, part.calibration.tubes);
  append(sum.sigma_over_bound, part.sigma_over_bound);
  append(sum.bound_rms_m, part.bound_rms_m);
  append(sum.radius_sigma_over_bound, part.radius_sigma_over_bound);
  append(sum.radius_bound_m, part.radius_bound_m);
  add(sum.bends, part.bends);
  append(sum.frame_ms, part.frame_ms);
  append(sum.stages, part.stages);
}

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::ranges::sort(values);
  const double place = part * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return std::lerp(values[below], values[above], place - static_cast<double>(below));
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double root_mean_square(const std::vector<double>& values) {
  return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0) /
                   static_cast<double>(values.size()));
}

StageTimes median_stages(const std::vector<StageTimes>& stages) {
  return {median_of(stages, [](const StageTimes& s) { return s.update_ms; }),
          median_of(stages, [](const StageTimes& s) { return s.normals_ms; }),
          median_of(stages, [](const StageTimes& s) { return s.accumulate_ms; }),
          median_of(stages, [](const StageTimes& s) { return s.trace_ms; }),
          median_of(stages, [](const StageTimes& s) { return s.fit_ms; }),
          median_of(stages, [](const StageTimes& s) { return s.segment_ms; })};
}

std::vector<double> radius_errors_m(const Calibration& calibration) {
  std::vector<double> errors;
  for (const TubeError& tube : calibration.tubes) {
    if (tube.true_id != 0) errors.push_back(std::abs(tube.radius_error_m));
  }
  return errors;
}

std::vector<double> radius_errors_relative(const Calibration& calibration) {
  std::vector<double> errors;
  for (const TubeError& tube : calibration.tubes) {
    if (tube.true_id != 0) errors.push_back(std::abs(tube.radius_error_m) / tube.true_radius_m);
  }
  return errors;
}

Calibration by_depth(const Calibration& calibration, double from_m, double to_m) {
  return within(
      calibration, from_m, to_m, [](const NodeError& n) { return n.true_point_m.z(); },
      [](const TubeError& t) { return t.depth_m; });
}

Calibration by_radius(const Calibration& calibration, double from_m, double to_m) {
  return within(
      calibration, from_m, to_m, [](const NodeError& n) { return n.true_radius_m; },
      [](const TubeError& t) { return t.true_radius_m; });
}

}  // namespace tubetrack::bench
