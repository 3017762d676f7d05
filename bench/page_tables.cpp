#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "goals.hpp"
#include "markdown.hpp"
#include "page.hpp"

namespace tubetrack::bench {

namespace {

const RowResult& ours(const RowReport& report) {
  return report.by_method.front();
}

double worst(const std::vector<double>& values) {
  return quantile(values, 1.0);
}

std::string false_cell(const Row& row, const Figures& f, const Goals& goals) {
  if (row.holds_tubes) return at_most(f.score.false_length(), goals.most_false_length, kPercent, 2);
  return fmt::format("{} tubes {}", f.reported_tubes, f.reported_tubes == 0 ? "✓" : "✗");
}

}  // namespace

std::string rows_table(const Report& report) {
  MarkdownTable table({"row", "shows"});
  for (const RowReport& row : report.rows) table.add({std::string(row.row.name), std::string(row.row.shows)});
  return table.text();
}

std::string single_table(const Report& report) {
  MarkdownTable table({"row", "frames", "RMS, mm (≤ 0.3)", "bound, mm", "toward camera, mm", "coverage, % (≥ 97)",
                       "false, % (≤ 0.5)", "radius error: median, mm", "median, %", "largest, mm", "largest, %",
                       "bias, mm"});
  for (const RowReport& row : report.rows) {
    const Figures& f = ours(row).single;
    if (f.frames == 0) continue;
    const Goals goals = goals_of(row.row);
    const auto radii_m = radius_errors_m(f.calibration);
    const auto radii = radius_errors_relative(f.calibration);
    table.add({std::string(row.row.name), std::to_string(f.frames),
               at_most(f.score.rms_m(), goals.rms_single_m, kMm, 3), number(root_mean_square(f.bound_rms_m) / kMm, 3),
               bias(f.calibration.toward_camera_m() / kMm, 3),
               at_least(f.score.coverage(), goals.least_coverage, kPercent, 1), false_cell(row.row, f, goals),
               number(median(radii_m) / kMm, 3), number(median(radii) / kPercent, 2), number(worst(radii_m) / kMm, 2),
               number(worst(radii) / kPercent, 1), bias(f.calibration.radius_error_m() / kMm, 3)});
  }
  return table.text();
}

std::string sequence_table(const Report& report) {
  MarkdownTable table({"row", "sequences", "frames", "RMS, mm", "coverage, % (≥ 97)", "false, % (≤ 0.5)",
                       "IDF1 (≥ 0.99)", "switches (0)", "transfers (0)", "inside 95 %"});
  for (const RowReport& row : report.rows) {
    const Figures& f = ours(row).sequence;
    if (f.frames == 0) continue;
    const Goals goals = goals_of(row.row);
    table.add({std::string(row.row.name), std::to_string(ours(row).last.frames), std::to_string(f.frames),
               number(f.score.rms_m() / kMm, 3), at_least(f.score.coverage(), goals.least_coverage, kPercent, 1),
               false_cell(row.row, f, goals), at_least(f.score.idf1(), goals.least_idf1, 1.0, 3),
               at_most(static_cast<double>(f.score.switches), 0.0, 1.0, 0),
               at_most(static_cast<double>(f.score.transfers), 0.0, 1.0, 0),
               between(f.calibration.nodes_inside(), goals.least_inside, goals.most_inside, kPercent, 1)});
  }
  return table.text();
}

std::string last_table(const Report& report) {
  MarkdownTable table({"row", "RMS, mm (at rest ≤ 0.12, else ≤ 0.3)", "toward camera, mm", "coverage, % (≥ 97)",
                       "radius error: median, mm (at rest ≤ 0.15)", "largest, mm", "bias, mm", "inside 95 % (93–97)",
                       "radius inside 95 %"});
  for (const RowReport& row : report.rows) {
    const Figures& f = ours(row).last;
    if (f.frames == 0 || !row.row.holds_tubes) continue;
    const Goals goals = goals_of(row.row);
    const auto radii_m = radius_errors_m(f.calibration);
    table.add({std::string(row.row.name), at_most(f.score.rms_m(), goals.rms_last_m, kMm, 3),
               bias(f.calibration.toward_camera_m() / kMm, 3),
               at_least(f.score.coverage(), goals.least_coverage, kPercent, 1),
               at_most(median(radii_m), goals.radius_last_m, kMm, 3), number(worst(radii_m) / kMm, 2),
               bias(f.calibration.radius_error_m() / kMm, 3),
               between(f.calibration.nodes_inside(), goals.least_inside, goals.most_inside, kPercent, 1),
               number(f.calibration.radii_inside() / kPercent, 0)});
  }
  return table.text();
}

std::string interval_table(const Report& report) {
  MarkdownTable table({"row", "nodes", "truth inside 95 %, % (93–97)", "mean σ / bound (≤ 1.5)", "tubes",
                       "radius inside 95 %, %", "its mean σ / bound"});
  for (const RowReport& row : report.rows) {
    const Figures& f = ours(row).single;
    if (f.calibration.nodes.empty()) continue;
    const Goals goals = goals_of(row.row);
    table.add({std::string(row.row.name), std::to_string(f.calibration.nodes.size()),
               between(f.calibration.nodes_inside(), goals.least_inside, goals.most_inside, kPercent, 1),
               at_most(mean(f.sigma_over_bound), goals.most_sigma_over_bound, 1.0, 2),
               std::to_string(radius_errors_m(f.calibration).size()),
               number(f.calibration.radii_inside() / kPercent, 1), number(mean(f.radius_sigma_over_bound), 2)});
  }
  return table.text();
}

std::string bins_table(const Report& report) {
  MarkdownTable table({"the row `random`", "nodes", "truth inside 95 %, % (93–97)", "tubes", "radius inside 95 %, %",
                       "radius bias, mm", "toward camera, mm"});
  const auto add = [&](const std::string& name, const Calibration& some) {
    if (some.nodes.empty()) return;
    table.add({name, std::to_string(some.nodes.size()), between(some.nodes_inside(), 0.93, 0.97, kPercent, 1),
               std::to_string(radius_errors_m(some).size()), number(some.radii_inside() / kPercent, 1),
               bias(some.radius_error_m() / kMm, 3), bias(some.toward_camera_m() / kMm, 3)});
  };
  for (const RowReport& row : report.rows) {
    if (!row.row.single_shots) continue;
    const Calibration& all = ours(row).single.calibration;
    for (const auto& [from, to] : {std::pair{0.0, 0.7}, {0.7, 0.9}, {0.9, 1.1}, {1.1, 1.3}, {1.3, 2.0}}) {
      add(fmt::format("depth {} – {} m", from, to), by_depth(all, from, to));
    }
    for (const auto& [from, to] :
         {std::pair{0.0, 0.012}, {0.012, 0.018}, {0.018, 0.025}, {0.025, 0.040}, {0.040, 0.2}}) {
      add(fmt::format("radius {} – {} mm", from / kMm, to / kMm), by_radius(all, from, to));
    }
  }
  return table.text();
}

std::string confidence_table(const Report& report) {
  std::vector<TubeError> tubes;
  for (const RowReport& row : report.rows) {
    for (const Figures* f : {&ours(row).single, &ours(row).sequence}) {
      tubes.insert(tubes.end(), f->calibration.tubes.begin(), f->calibration.tubes.end());
    }
  }
  MarkdownTable table({"confidence at least", "true tubes kept", "of all, %", "false tubes kept"});
  const auto real =
      static_cast<double>(std::ranges::count_if(tubes, [](const TubeError& t) { return t.true_id != 0; }));
  for (const double least : {0.0, 0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 0.98}) {
    const auto kept =
        std::ranges::count_if(tubes, [&](const TubeError& t) { return t.true_id != 0 && t.confidence >= least; });
    const auto wrong =
        std::ranges::count_if(tubes, [&](const TubeError& t) { return t.true_id == 0 && t.confidence >= least; });
    table.add({number(least, 2), std::to_string(kept), number(static_cast<double>(kept) / real / kPercent, 1),
               std::to_string(wrong)});
  }
  return table.text();
}

std::string peers_table(const Report& report) {
  MarkdownTable table({"row", "method", "RMS, mm", "coverage, %", "false, %", "radius error: median, mm", "bias, mm",
                       "tubes a frame", "ms a frame, median"});
  for (const RowReport& row : report.rows) {
    for (std::size_t i = 0; i < row.by_method.size(); ++i) {
      const Figures& f = row.by_method[i].single;
      if (f.frames == 0) continue;
      table.add({i == 0 ? std::string(row.row.name) : "", report.methods[i], number(f.score.rms_m() / kMm, 2),
                 number(f.score.coverage() / kPercent, 1), number(f.score.false_length() / kPercent, 1),
                 number(median(radius_errors_m(f.calibration)) / kMm, 2), bias(f.calibration.radius_error_m() / kMm, 2),
                 number(static_cast<double>(f.reported_tubes) / static_cast<double>(f.frames), 1),
                 number(median(f.frame_ms), 1)});
    }
  }
  return table.text();
}

std::string time_table(const Report& report) {
  MarkdownTable table({"row", "one frame alone, ms", "in a sequence, ms", "99 % below, ms", "update", "normals",
                       "accumulate", "trace", "fit", "segment"});
  for (const RowReport& row : report.rows) {
    const bool followed = ours(row).sequence.frames > 0;
    const Figures& f = followed ? ours(row).sequence : ours(row).single;
    if (f.frames == 0) continue;
    const StageTimes s = median_stages(f.stages);
    table.add({std::string(row.row.name), number(median(ours(row).single.frame_ms), 1),
               followed ? number(median(f.frame_ms), 1) : "–", number(quantile(f.frame_ms, 0.99), 1),
               number(s.update_ms, 1), number(s.normals_ms, 1), number(s.accumulate_ms, 1), number(s.trace_ms, 1),
               number(s.fit_ms, 1), number(s.segment_ms, 1)});
  }
  return table.text();
}

std::string ablation_table(const Report& report) {
  MarkdownTable table({"noise", "frames", "RMS, mm", "toward camera, mm", "radius bias, mm", "radius error: median, mm",
                       "truth inside 95 %, %"});
  for (const AblationStep& step : report.ablation) {
    const Figures& f = step.figures;
    table.add({step.noise, std::to_string(f.frames), number(f.score.rms_m() / kMm, 3),
               bias(f.calibration.toward_camera_m() / kMm, 3), bias(f.calibration.radius_error_m() / kMm, 3),
               number(median(radius_errors_m(f.calibration)) / kMm, 3),
               number(f.calibration.nodes_inside() / kPercent, 1)});
  }
  return table.text();
}

}  // namespace tubetrack::bench
