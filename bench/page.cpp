#include "page.hpp"

#include <fmt/format.h>

#include <iterator>

#include "markdown.hpp"

namespace tubetrack::bench {

namespace {

constexpr const char* kHowMeasured = R"(## How it is measured

Scenes are drawn from seeds (`bench/rows_*.cpp`), rendered by exact ray casting with the noise of docs/scene.md, and
tracked with the default configuration: the radius is not told. Coverage, RMS, false length and identity are those of
`tubetrack eval`. Besides:

- **toward camera** is the mean signed error of the reported nodes along the ray, **bias** that of the radius: what
  doesn't average out. Positive is too near, and too thick.
- **truth inside 95 %**: for every node flagged visible, the error across the true centreline, in the reported
  covariance's units, is χ² with two degrees of freedom; counted is what stays below 5.99. For radii: within 1.96 σ.
- **bound** is the Cramér-Rao bound: no unbiased estimate has a smaller error. It takes the exact geometry and one
  reading, with the noise model's σ at the true incidence (lateral jitter included), for each pixel with a return that
  sees the tube at less than 75°. It asks how well a piece of centreline can be placed across the tube when the piece's
  shape is known, the radius is one unknown number for the whole tube, and nothing else helps. The column *bound* is the
  root mean square of both axes together, beside the RMS; *σ / bound* compares the larger axis of each node with that of
  its piece.
- a frame's time is that of the whole call, on one thread, beside whatever else the machine did; performance.md is where
  speed is measured.
- `pose-errors` has goals of its own: 3.5 mm, and no interval, as none can know of a wrong pose. A goal is judged in the
  rows that have tubes and a figure for it; after 30 frames "at rest" are those in which camera and tubes are.

The seeds of this page (`held-out`, from 1000001) are not those that `accuracy_suite` shows by default (`tuning`, from 1).
)";

constexpr const char* kAblation = R"(## Where bias comes from

The rows `straight` and `bent`, single frames, with parts of the noise switched off or alone (docs/scene.md says what
each part does). The tracker is the same in all of them and expects all of the noise, so the intervals are too wide where
parts are off. A bias that a part brings shows as the difference between "without" it and "all"; one that is corrected
leaves none. Its correction stays on where the part is off, and then is a bias itself.

)";

/// The bound's piece beside the tracker's own smoothing, which it has to be like.
std::string piece_text(const Report& report) {
  Calibration usual;
  for (const RowReport& row : report.rows) {
    if (row.row.name != "straight" && row.row.name != "bent" && !row.row.single_shots) continue;
    const auto& nodes = row.by_method.front().single.calibration.nodes;
    usual.nodes.insert(usual.nodes.end(), nodes.begin(), nodes.end());
  }
  return fmt::format(
      "The bound's pieces are {:g} × the diameter long. The tracker's own smoothing, by how far errors sideways are "
      "alike (rows `straight`, `bent`, `random`): {} diameters. A tracker that smooths over more than a piece can fall "
      "below the bound; one that smooths over less can't reach it.\n\n",
      report.about.bound_piece_diameters, number(0.5 * smoothing_radii(usual), 1));
}

}  // namespace

std::string page_head(const char* title, const Report& report) {
  std::string methods;
  for (std::size_t i = 1; i < report.methods.size(); ++i) methods += (i == 1 ? "" : ", ") + report.methods[i];
  return fmt::format(
      "# {}\n\nWritten by `{}`; don't edit.\n\n"
      "| | |\n| --- | --- |\n| commit | {} |\n| compiler | {} |\n| CPU | {} |\n| suite | {}, seeds "
      "from {} "
      "|\n| peers | {} |\n\n",
      title, report.about.command, report.about.commit, compiler(), report.about.cpu, report.about.suite,
      report.about.first_seed, methods.empty() ? "not run (`--peers`)" : methods);
}

std::string page(const Report& report) {
  std::string text = page_head("How accurate tubetrack is", report);
  const auto section = [&](const char* title, const char* before, const std::string& table) {
    fmt::format_to(std::back_inserter(text), "## {}\n\n{}{}\n", title, before, table);
  };
  section("The goals", "✓ and ✗ below say whether a figure meets its goal; the goals are beside the headings.\n\n",
          goals_table(report));
  section("The rows", "", rows_table(report));
  text += kHowMeasured;
  text += "\n" + piece_text(report);
  section("One frame", "A fresh tracker for each frame.\n\n", single_table(report));
  section("Thirty frames", "All frames of the sequences.\n\n", sequence_table(report));
  section("The thirtieth frame", "The last frame of each sequence alone (`leaving`: the 45th).\n\n",
          last_table(report));
  section("Intervals", "Single frames. Nodes of one tube err together, so few tubes leave these shares uncertain.\n\n",
          interval_table(report));
  section("Intervals by depth and by radius", "", bins_table(report));
  section(
      "Confidence",
      "What a threshold on `confidence` keeps, over all frames of all rows. A tube is false when less than half of it "
      "lies on a true one.\n\n",
      confidence_table(report));
  if (report.methods.size() > 1) {
    section(
        "Peers",
        "The same single frames. Large planes are taken out first for both. PCL: SACSegmentationFromNormals on PCA "
        "normals of 50 neighbours, normal weight 0.01, repeated for several cylinders. CGAL: Efficient RANSAC on jet "
        "normals, radii filtered afterwards. Both find straight pieces only.\n\n",
        peers_table(report));
  }
  section("Time", "Medians over frames; stages are those of the sequences where there are any.\n\n",
          time_table(report));
  if (!report.ablation.empty()) text += kAblation + ablation_table(report);
  return text;
}

}  // namespace tubetrack::bench
