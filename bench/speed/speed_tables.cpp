#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "figures.hpp"
#include "goals.hpp"
#include "markdown.hpp"
#include "speed_page.hpp"
#include "statistics.hpp"

namespace tubetrack::bench {

namespace {

double all_stages(const StageTimes& s) {
  return s.update_ms + s.normals_ms + s.accumulate_ms + s.trace_ms + s.fit_ms + s.segment_ms;
}

/// Medians of the stages, and of what is left of the whole call.
std::vector<std::string> stage_cells(const std::vector<StageTimes>& stages, const std::vector<double>& wall_ms) {
  const StageTimes m = median_stages(stages);
  std::vector<double> rest_ms;
  for (std::size_t i = 0; i < std::min(stages.size(), wall_ms.size()); ++i) {
    rest_ms.push_back(wall_ms[i] - all_stages(stages[i]));
  }
  std::vector<std::string> cells;
  for (const double ms : {median(wall_ms), m.update_ms, m.normals_ms, m.accumulate_ms, m.trace_ms, m.fit_ms,
                          m.segment_ms, median(rest_ms)}) {
    cells.push_back(number(ms, 2));
  }
  return cells;
}

std::string tubes_cell(double reported, int there) {
  return fmt::format("{} of {}", number(reported, 2), there);
}

std::string ask(double goal) {
  return std::isfinite(goal) ? fmt::format("≤ {:g}", goal) : "–";
}

}  // namespace

double fit_ms_per_1000_pixels(const SpeedRow& row) {
  return row.tube_pixels > 0.0 ? median_stages(row.stages).fit_ms / (row.tube_pixels / 1000.0) : kNoGoal;
}

double changes_exponent(const std::vector<SpeedRow>& rows) {
  std::vector<double> cells;
  std::vector<double> above_ms;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    cells.push_back(rows[i].changed_cells - rows[0].changed_cells);
    above_ms.push_back(median(rows[i].frame_ms) - median(rows[0].frame_ms));
  }
  return power_exponent(cells, above_ms);
}

std::string scenes_table(const SpeedReport& report) {
  MarkdownTable table({"scene", "tubes reported", "frames", "median ms", "goal", "p99 ms", "goal",
                       "on the wall, median ms", "memcpy ms", "floor pass ms", "FALS ms", "over floor pass",
                       "over FALS", "above FALS, ms"});
  for (const SpeedRow& row : report.scenes) {
    const double frame_ms = median(row.frame_ms);
    const double floor_ms = median(row.floor_ms);
    const double fals_ms = median(row.fals_ms);
    const TimeGoal goal = time_goal(row);
    const bool moving = row.name == "moving tube";  // the scene that the ratios are asked of
    table.add({row.name, tubes_cell(row.mean_tubes, row.true_tubes), std::to_string(row.frame_ms.size()),
               at_most(frame_ms, goal.median_ms, 1.0, 2), ask(goal.median_ms),
               at_most(p99(row.frame_ms), goal.p99_ms, 1.0, 2), ask(goal.p99_ms), number(median(row.wall_ms), 2),
               number(median(row.copy_ms), 3), number(floor_ms, 3), number(fals_ms, 2),
               at_most(frame_ms / floor_ms, moving ? 4.5 : kNoGoal, 1.0, 1), number(frame_ms / fals_ms, 2),
               at_most(frame_ms - fals_ms, moving ? 1.0 : kNoGoal, 1.0, 2)});
  }
  return table.text();
}

std::string stages_table(const SpeedReport& report) {
  MarkdownTable table({"scene", "frame", "update", "normals", "accumulate", "trace", "fit", "segment", "rest",
                       "pixels on tubes", "fit, ms for 1,000 of them"});
  for (const SpeedRow& row : report.scenes) {
    std::vector<std::string> cells = {row.name};
    std::ranges::move(stage_cells(row.stages, row.wall_ms), std::back_inserter(cells));
    cells.push_back(number(row.tube_pixels, 0));
    cells.push_back(at_most(fit_ms_per_1000_pixels(row), 0.03, 1.0, 3));
    table.add(std::move(cells));
  }
  return table.text();
}

std::string first_table(const SpeedReport& report) {
  MarkdownTable table({"scene", "tubes reported", "frames", "median ms (goal ≤ 15)", "slowest ms", "update", "normals",
                       "accumulate", "trace", "fit", "segment", "rest"});
  for (const FirstFrames& first : report.first) {
    std::vector<std::string> cells = {first.name, tubes_cell(first.mean_tubes, first.true_tubes),
                                      std::to_string(first.ms.size()), at_most(median(first.ms), 15.0, 1.0, 1),
                                      number(quantile(first.ms, 1.0), 1)};
    const std::vector<std::string> stages = stage_cells(first.stages, first.wall_ms);
    cells.insert(cells.end(), stages.begin() + 1, stages.end());
    table.add(std::move(cells));
  }
  return table.text();
}

std::string rivals_table(const SpeedReport& report) {
  MarkdownTable table(
      {"what", "does", "pieces found", "frames", "median ms", "p99 ms", "over tubetrack", "over floor pass"});
  const auto moving = std::ranges::find(report.scenes, "moving tube", &SpeedRow::name);
  if (moving == report.scenes.end()) return table.text();
  const double tubetrack_ms = median(moving->frame_ms);
  const double floor_ms = median(moving->floor_ms);
  const auto add = [&](const std::string& name, const std::string& does, const std::vector<double>& ms, double found) {
    if (ms.empty()) return;
    table.add({name, does, number(found, 2), std::to_string(ms.size()), number(median(ms), 2), number(p99(ms), 2),
               number(median(ms) / tubetrack_ms, 2), number(median(ms) / floor_ms, 1)});
  };
  add("tubetrack", "depth to fitted tubes", moving->frame_ms, moving->mean_tubes);
  add("memcpy", "copies the frame", moving->copy_ms, kNoGoal);
  add("floor pass", "metres, and the mean of 7 × 7 pixels", moving->floor_ms, kNoGoal);
  add("OpenCV FALS", "normals alone, 7 × 7, of points already there", moving->fals_ms, kNoGoal);
  for (const PeerTimes& peer : report.peers) add(peer.name, peer.does, peer.ms, peer.mean_tubes);
  return table.text();
}

std::string growth_table(const std::vector<SpeedRow>& rows) {
  MarkdownTable table({"row", "size", "tubes reported", "frames", "median ms", "p99 ms", "floor pass ms",
                       "over floor pass", "over the first row"});
  for (const SpeedRow& row : rows) {
    const double frame_ms = median(row.frame_ms);
    table.add({row.name, fmt::format("{} × {}", row.width, row.height), tubes_cell(row.mean_tubes, row.true_tubes),
               std::to_string(row.frame_ms.size()), number(frame_ms, 2), number(p99(row.frame_ms), 2),
               number(median(row.floor_ms), 3), number(frame_ms / median(row.floor_ms), 1),
               number(frame_ms / median(rows.front().frame_ms), 2)});
  }
  return table.text();
}

std::string threads_table(const std::vector<ThreadsRow>& rows) {
  MarkdownTable table({"scene", "one thread, median ms", "two threads", "quicker by", "floor pass, one thread",
                       "two threads", "quicker by", "share of the floor pass's (≥ 0.8)"});
  for (const ThreadsRow& row : rows) {
    std::vector<std::string> cells = {row.name};
    for (const auto& ms : {row.frame_ms, row.floor_ms}) {
      const double one_ms = median(ms[0]), two_ms = median(ms[1]);
      for (const double figure : {one_ms, two_ms, one_ms / two_ms}) cells.push_back(number(figure, 2));
    }
    cells.push_back(at_least(row.share_of_floor(), 0.8, 1.0, 2));
    table.add(std::move(cells));
  }
  return table.text();
}

std::string changes_table(const std::vector<SpeedRow>& rows) {
  MarkdownTable table({"cells that change", "frames", "median ms", "p99 ms", "above the first row, ms",
                       "ns for each cell more than there"});
  for (const SpeedRow& row : rows) {
    const double above_ms = median(row.frame_ms) - median(rows.front().frame_ms);
    const double more = row.changed_cells - rows.front().changed_cells;
    table.add({number(row.changed_cells, 0), std::to_string(row.frame_ms.size()), number(median(row.frame_ms), 2),
               number(p99(row.frame_ms), 2), number(above_ms, 2), more > 0.0 ? number(1e6 * above_ms / more, 1) : "–"});
  }
  return table.text();
}

}  // namespace tubetrack::bench
