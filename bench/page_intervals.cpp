#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "goals.hpp"
#include "markdown.hpp"
#include "page.hpp"

namespace tubetrack::bench {

namespace {

constexpr const char* kIntervalsText = R"(## How to read it

Scenes and seeds are those of [accuracy.md](accuracy.md), only more of them. For every node flagged visible the error
across the true centreline, in the reported covariance's units, is χ² with two degrees of freedom: its mean should be 2,
and 95 % should stay below 5.99. Of radii 95 % should be off by no more than 1.96 σ.

- **inside** is that share, with its standard error. The nodes of a tube err together, so the standard error counts
  tubes: it is that of a ratio whose terms are the tubes' sums. That of radii is at least what chance makes of so many
  tubes of which each is inside in 95 of 100 cases.
- **error / σ** is the root of χ²'s mean over what it should be (for radii: the root mean square of error over σ). 1 is
  right, more says that σ is too small, less that it is too large. It tells more than the share does of so few tubes, as
  it does not ask only what is far out.
- ✓: the share is within 93–97 %. ~: it is not, but by less than two standard errors, so it may be chance. ✗: it is not,
  and that is hardly chance.
)";

/// A share or a mean, with its standard error.
struct Measured {
  double value = std::numeric_limits<double>::quiet_NaN();
  double error = std::numeric_limits<double>::quiet_NaN();
};

/// What one tube adds: the sum of its values, and how many there are.
struct Part {
  double sum = 0.0, count = 0.0;
};

/// The ratio of the sums, and its standard error as the parts scatter about it. NaN of nothing.
Measured ratio_of(const std::vector<Part>& parts) {
  Part all;
  for (const Part& part : parts) all = {all.sum + part.sum, all.count + part.count};
  Measured ratio;
  if (all.count == 0.0) return ratio;
  ratio.value = all.sum / all.count;
  if (parts.size() < 2) return ratio;
  double squares = 0.0;
  for (const Part& part : parts) squares += std::pow(part.sum - ratio.value * part.count, 2);
  const auto n = static_cast<double>(parts.size());
  ratio.error = std::sqrt(squares * n / (n - 1.0)) / all.count;
  return ratio;
}

template <class Value>
Measured over_nodes(const Calibration& calibration, Value value) {
  std::vector<Part> parts;
  for (const NodeError& node : calibration.nodes) {
    if (node.first || parts.empty()) parts.emplace_back();
    parts.back().sum += value(node);
    parts.back().count += 1.0;
  }
  return ratio_of(parts);
}

template <class Value>
Measured over_radii(const Calibration& calibration, Value value) {
  std::vector<Part> parts;
  for (const TubeError& tube : calibration.tubes) {
    if (tube.true_id != 0) parts.push_back({value(tube), 1.0});
  }
  return ratio_of(parts);
}

/// Of the radii inside. Where all of few are, their scatter says nothing of how sure the share is.
Measured radii_inside(const Calibration& calibration) {
  Measured share = over_radii(calibration, [](const TubeError& tube) { return tube.inside() ? 1.0 : 0.0; });
  const auto tubes = static_cast<double>(radius_errors_m(calibration).size());
  share.error = std::max(share.error, std::sqrt(0.95 * 0.05 / tubes));
  return share;
}

/// The root of a mean square.
Measured root(const Measured& square) {
  const double value = std::sqrt(square.value);
  return {value, square.error / (2.0 * value)};
}

std::string share_cell(const Measured& share, const Goals& goals) {
  if (!std::isfinite(share.value)) return "–";
  const double off = std::max(goals.least_inside - share.value, share.value - goals.most_inside);
  const char* mark = !std::isfinite(off) ? "" : off <= 0.0 ? " ✓" : off < 2.0 * share.error ? " ~" : " ✗";
  return fmt::format("{} ± {}{}", number(share.value / kPercent, 1), number(share.error / kPercent, 1), mark);
}

std::string ratio_cell(const Measured& ratio) {
  return std::isfinite(ratio.value) ? fmt::format("{} ± {}", number(ratio.value, 2), number(ratio.error, 2)) : "–";
}

MarkdownTable interval_columns(const char* first) {
  return MarkdownTable({first, "tubes", "nodes", "nodes inside, % (93–97)", "their error / σ",
                        "radii inside, % (93–97)", "their error / σ", "toward camera, mm", "radius bias, mm"});
}

void add_line(const std::string& name, const Calibration& some, const Goals& goals, MarkdownTable& table) {
  if (some.nodes.empty()) return;
  const auto square = [](const TubeError& t) { return std::pow(t.radius_error_m / t.radius_sigma_m, 2); };
  table.add({name, std::to_string(radius_errors_m(some).size()), std::to_string(some.nodes.size()),
             share_cell(over_nodes(some, [](const NodeError& n) { return n.inside() ? 1.0 : 0.0; }), goals),
             ratio_cell(root(over_nodes(some, [](const NodeError& n) { return 0.5 * n.chi2; }))),
             share_cell(radii_inside(some), goals), ratio_cell(root(over_radii(some, square))),
             bias(some.toward_camera_m() / kMm, 3), bias(some.radius_error_m() / kMm, 3)});
}

using Kind = Figures RowResult::*;

std::string by_row(const Report& report, Kind kind) {
  MarkdownTable table = interval_columns("row");
  for (const RowReport& row : report.rows)
    add_line(std::string(row.row.name), (row.by_method.front().*kind).calibration, goals_of(row.row), table);
  return table.text();
}

std::string by_bin(const Report& report, Kind kind, bool (*counts)(const Row&)) {
  Calibration all;
  for (const RowReport& row : report.rows) {
    if (!counts(row.row)) continue;
    const Calibration& some = (row.by_method.front().*kind).calibration;
    all.nodes.insert(all.nodes.end(), some.nodes.begin(), some.nodes.end());
    all.tubes.insert(all.tubes.end(), some.tubes.begin(), some.tubes.end());
  }
  MarkdownTable table = interval_columns("bin");
  for (const auto& [from, to] : {std::pair{0.0, 0.7}, {0.7, 0.9}, {0.9, 1.1}, {1.1, 1.3}, {1.3, 2.0}})
    add_line(fmt::format("depth {} – {} m", from, to), by_depth(all, from, to), {}, table);
  for (const auto& [from, to] : {std::pair{0.0, 0.006}, {0.006, 0.012}, {0.012, 0.018}, {0.018, 0.025}, {0.025, 0.2}})
    add_line(fmt::format("radius {} – {} mm", from / kMm, to / kMm), by_radius(all, from, to), {}, table);
  return table.text();
}

}  // namespace

std::string intervals_page(const Report& report) {
  std::string text = page_head("How far the intervals hold", report);
  text += kIntervalsText;
  const auto section = [&](const char* title, const char* before, const std::string& table) {
    fmt::format_to(std::back_inserter(text), "\n## {}\n\n{}{}", title, before, table);
  };
  section("The thirtieth frame", "The last frame of each sequence (`leaving`: the 45th).\n\n",
          by_row(report, &RowResult::last));
  section("The thirtieth frame by depth and by radius", "All rows in which tubes and camera rest.\n\n",
          by_bin(report, &RowResult::last, [](const Row& row) { return row.at_rest; }));
  section("One frame", "A fresh tracker for each frame.\n\n", by_row(report, &RowResult::single));
  section("One frame by depth and by radius", "The row `random`.\n\n",
          by_bin(report, &RowResult::single, [](const Row& row) { return row.single_shots; }));
  return text;
}

}  // namespace tubetrack::bench
