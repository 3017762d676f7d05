#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "goals.hpp"
#include "markdown.hpp"
#include "page.hpp"

namespace tubetrack::bench {

namespace {

/// One line of DESIGN §5: what a row has, and what it should have. A row without the one or the other does not count.
struct Line {
  std::string what;
  std::string goal;
  double unit = 1.0;
  int digits = 3;
  std::function<double(const RowReport&)> value;
  std::function<double(const Goals&)> asked;
  bool at_least = false;
};

const Figures& single(const RowReport& row) {
  return row.by_method.front().single;
}
const Figures& whole(const RowReport& row) {
  return row.by_method.front().sequence;
}
const Figures& last(const RowReport& row) {
  return row.by_method.front().last;
}

/// Nothing was run: no value, rather than a zero that meets every goal.
double of(const Figures& figures, double value) {
  return figures.frames > 0 ? value : kNoGoal;
}

constexpr double kDegree = std::numbers::pi / 180.0;

double off_95_percent(const Figures& figures) {
  return std::abs(figures.calibration.nodes_inside() - 0.95);
}

double asked_off_95_percent(const Goals& goals) {
  return goals.most_inside - 0.95;
}

std::vector<Line> single_lines() {
  return {
      {"single frame: centreline RMS", "≤ 0.3 mm", 0.001, 3, [](const RowReport& r) { return single(r).score.rms_m(); },
       [](const Goals& g) { return g.rms_single_m; }},
      {"single frame: coverage", "≥ 97 %", 0.01, 1, [](const RowReport& r) { return single(r).score.coverage(); },
       [](const Goals& g) { return g.least_coverage; }, true},
      {"single frame: false length", "≤ 0.5 %", 0.01, 2,
       [](const RowReport& r) { return single(r).score.false_length(); },
       [](const Goals& g) { return g.most_false_length; }},
      {"single frame: share of truth inside the 95 % interval, off 95 % by", "≤ 2 points", 0.01, 1,
       [](const RowReport& r) { return off_95_percent(single(r)); }, asked_off_95_percent},
      {"single frame: mean σ over the Cramér-Rao bound", "≤ 1.5", 1.0, 2,
       [](const RowReport& r) { return mean(single(r).sigma_over_bound); },
       [](const Goals& g) { return g.most_sigma_over_bound; }},
  };
}

std::vector<Line> sequence_lines() {
  return {
      {"frame 30: centreline RMS", "≤ 0.12 mm at rest, ≤ 0.3 mm else", 0.001, 3,
       [](const RowReport& r) { return last(r).score.rms_m(); }, [](const Goals& g) { return g.rms_last_m; }},
      {"frame 30, at rest: radius error, median", "≤ 0.15 mm", 0.001, 3,
       [](const RowReport& r) { return median(radius_errors_m(last(r).calibration)); },
       [](const Goals& g) { return g.radius_last_m; }},
      {"frame 30: share of truth inside the 95 % interval, off 95 % by", "≤ 2 points", 0.01, 1,
       [](const RowReport& r) { return off_95_percent(last(r)); }, asked_off_95_percent},
      {"frame 30: bend angle error, median", "≤ 0.3°", kDegree, 2,
       [](const RowReport& r) { return median(last(r).bends.angle_rad); }, [](const Goals&) { return 0.3 * kDegree; }},
      {"frame 30: bend radius error, median", "≤ 2 %", 0.01, 2,
       [](const RowReport& r) { return median(last(r).bends.bend_radius_relative); },
       [](const Goals&) { return 0.02; }},
      {"frame 30: rotation error, median", "≤ 0.5°", kDegree, 2,
       [](const RowReport& r) { return median(last(r).bends.rotation_rad); },
       [](const Goals&) { return 0.5 * kDegree; }},
      {"30 frames: coverage", "≥ 97 %", 0.01, 1, [](const RowReport& r) { return whole(r).score.coverage(); },
       [](const Goals& g) { return g.least_coverage; }, true},
      {"30 frames: false length", "≤ 0.5 %", 0.01, 2, [](const RowReport& r) { return whole(r).score.false_length(); },
       [](const Goals& g) { return g.most_false_length; }},
      {"30 frames: IDF1", "≥ 0.99", 1.0, 3, [](const RowReport& r) { return whole(r).score.idf1(); },
       [](const Goals& g) { return g.least_idf1; }, true},
      {"30 frames: identity switches", "0", 1.0, 0,
       [](const RowReport& r) { return of(whole(r), static_cast<double>(whole(r).score.switches)); },
       [](const Goals&) { return 0.0; }},
  };
}

/// How many rows meet it, and the one that is farthest from it.
std::vector<std::string> judged(const Line& line, const std::vector<RowReport>& rows) {
  int met = 0;
  int asked_of = 0;
  double worst_part = -1.0;
  std::string worst = "–";
  for (const RowReport& row : rows) {
    if (!row.row.holds_tubes) continue;
    const double value = line.value(row);
    const double asked = line.asked(goals_of(row.row));
    if (!std::isfinite(value) || !std::isfinite(asked)) continue;
    ++asked_of;
    met += (line.at_least ? value >= asked : value <= asked) ? 1 : 0;
    const double part = line.at_least ? asked / std::max(value, 1e-9) : (value + 1e-9) / (asked + 1e-9);
    if (part <= worst_part) continue;
    worst_part = part;
    worst = fmt::format("{} ({})", number(value / line.unit, line.digits), row.row.name);
  }
  if (asked_of == 0) return {line.what, line.goal, "–", "not measured"};
  return {line.what, line.goal, worst,
          met == asked_of ? fmt::format("all {}", met) : fmt::format("{} of {}", met, asked_of)};
}

}  // namespace

std::string goals_table(const Report& report) {
  MarkdownTable table({"figure", "goal", "worst row", "rows that meet it"});
  for (const Line& line : single_lines()) table.add(judged(line, report.rows));
  for (const Line& line : sequence_lines()) table.add(judged(line, report.rows));
  std::int64_t false_tubes = 0;
  std::int64_t frames = 0;
  for (const RowReport& row : report.rows) {
    if (row.row.holds_tubes) continue;
    false_tubes += single(row).reported_tubes + whole(row).reported_tubes;
    frames += single(row).frames + whole(row).frames;
  }
  table.add({"tubes reported in scenes without tubes", "none", fmt::format("{} in {} frames", false_tubes, frames),
             frames == 0 ? "not measured" : (false_tubes == 0 ? "yes" : "no")});
  return table.text();
}

}  // namespace tubetrack::bench
