#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "figures.hpp"
#include "goals.hpp"
#include "markdown.hpp"
#include "speed_page.hpp"
#include "statistics.hpp"

namespace tubetrack::bench {

namespace {

// Noise of the machine and few points: what counts as "linear" and as "does not grow".
constexpr double kMostExponent = 1.1;
constexpr double kMostGrowth = 1.1;

/// Of nothing: no value, so that it meets no goal.
const SpeedRow* scene(const SpeedReport& report, std::string_view name) {
  const auto found = std::ranges::find(report.scenes, name, &SpeedRow::name);
  return found == report.scenes.end() ? nullptr : &*found;
}

double time_of(const SpeedRow* row) {
  return row == nullptr ? kNoGoal : median(row->frame_ms);
}

/// The quickest of the peers whose name begins so.
double quickest_peer(const SpeedReport& report, std::string_view name) {
  double least = kNoGoal;
  for (const PeerTimes& peer : report.peers) {
    if (peer.name.starts_with(name)) least = std::fmin(least, median(peer.ms));
  }
  return least;
}

double dearest_fit(const SpeedReport& report) {
  double most = kNoGoal;
  for (const SpeedRow& row : report.scenes) most = std::fmax(most, fit_ms_per_1000_pixels(row));
  return most;
}

double slowest_first(const SpeedReport& report) {
  double most = kNoGoal;
  for (const FirstFrames& first : report.first) most = std::fmax(most, median(first.ms));
  return most;
}

double growth(const std::vector<SpeedRow>& rows) {
  return rows.size() < 2 ? kNoGoal : median(rows.back().frame_ms) / median(rows.front().frame_ms);
}

std::string known(std::string judged) {
  return judged == "–" ? "not measured" : judged;
}

}  // namespace

TimeGoal time_goal(const SpeedRow& row) {
  if (row.name == "still") return {1.4, kNoGoal};
  if (row.name == "moving tube") return {2.8, 5.6};
  if (row.name == "moving camera") return {5.6, kNoGoal};
  return {kNoGoal, kNoGoal};
}

std::string speed_goals(const SpeedReport& report, double peak_memory_mb) {
  MarkdownTable table({"figure", "goal", "measured"});
  const auto most = [&](const char* what, const char* asked, double value, double goal, int digits) {
    table.add({what, asked, known(at_most(value, goal, 1.0, digits))});
  };
  const SpeedRow* moving = scene(report, "moving tube");
  const double moving_ms = time_of(moving);
  const double floor_ms = moving == nullptr ? kNoGoal : median(moving->floor_ms);
  const double fals_ms = moving == nullptr ? kNoGoal : median(moving->fals_ms);
  most("moving tube, median", "≤ 2.8 ms", moving_ms, 2.8, 2);
  most("moving tube, p99", "≤ 5.6 ms", moving == nullptr ? kNoGoal : p99(moving->frame_ms), 5.6, 2);
  most("moving camera, median", "≤ 5.6 ms", time_of(scene(report, "moving camera")), 5.6, 2);
  most("still scene, median", "≤ 1.4 ms", time_of(scene(report, "still")), 1.4, 2);
  most("moving tube over the floor pass", "≤ 4.5", moving_ms / floor_ms, 4.5, 1);
  most("moving tube above FALS alone", "≤ 1 ms", moving_ms - fals_ms, 1.0, 2);
  table.add({"PCL's normals and cylinder (the quicker of its two) over moving tube", "≥ 20",
             known(at_least(quickest_peer(report, "PCL") / moving_ms, 20.0, 1.0, 1))});
  most("fit, for 1,000 pixels on tubes, dearest scene", "≤ 0.03 ms", dearest_fit(report), 0.03, 3);
  most("first frame, radius 5–100 mm, median, slowest scene", "≤ 15 ms", slowest_first(report), 15.0, 1);
  most("peak memory of a run with tubetrack alone", "≤ 300 MB", peak_memory_mb > 0.0 ? peak_memory_mb : kNoGoal, 300.0,
       0);
  const auto moving_threads = std::ranges::find(report.threads, "moving tube", &ThreadsRow::name);
  table.add({"moving tube: what two threads gain, over what the floor pass gains by them", "≥ 0.8",
             known(at_least(moving_threads == report.threads.end() ? kNoGoal : moving_threads->share_of_floor(), 0.8,
                            1.0, 2))});
  table.add({"exponent of the time in the cells that change", "0 to 1.1",
             known(between(changes_exponent(report.changes), 0.0, kMostExponent, 1.0, 2))});
  most("time with 64 times the volume over time with 1", "≤ 1.1", growth(report.volumes), kMostGrowth, 2);
  return table.text();
}

}  // namespace tubetrack::bench
