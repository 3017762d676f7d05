// The benchmarks of static scans.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "bend_study.hpp"
#include "holed_tube.hpp"
#include "normal_study.hpp"
#include "page_head.hpp"
#include "paper_table.hpp"

namespace tubetrack::bench {
namespace {

constexpr const char* kBendsHow = R"(
Each tube has 1 to 6 bends of 30° to 180° in planes turned at random, bend radii of 1.5 to 10 diameters, straights of 1
to 6 diameters, a radius of 4 to 15 mm (`bench/scans/random_tubes.cpp`), and is a mesh of 6 to 10 grid steps a radius
whose points err by 1 % of the radius (σ) along the surface's normal. "From one side" leaves the faces that look toward a viewer who
sees the tube lying: half of every section. Nothing is told to the search, not even the radius. The errors are of the
tubes whose number of bends is right; a straight at an end goes to where the surface ends. Shares of 1,000 tubes have
standard errors of 0.4 to 0.5 points; of 200 tubes 0.8 to 1.1, which tells 95 from 97 % too badly.
)";

constexpr const char* kPaperHow = R"(
Scans are made like the paper's (`bench/scans/paper_scans.cpp`), of a tube in bends of 72° whose radius is as many grid
steps as there, with as many faces; the paper's own are not public. A voxel is such a grid step. *Paper* is what it
published (fig. 7, a 2.5 GHz Core i7). *Transcription* is its algorithms 1 and 2 as they stand there, told the radius
(`bench/scans/paper_transcription.cpp`), without its optimisation of centres. *Ours* is all of `tubetrack scan` but
reading the file: surfels, votes, lines, fit, parts; not told the radius. Seconds are processor time of one thread, ours the median of five runs (of what takes over a second, of one). *Length
found* is that of all tubes over the true one.
)";

constexpr const char* kNormalsHow = R"(
A torus of 60 and 12 mm, digitised: the mean error of the normals, and in brackets the largest; lengths in grid steps,
the time of the finest grid. *Smoothed* averages the boundary faces' own normals over a ball, *planes* are least squares,
*Voronoi* is the Voronoi covariance measure (Cuel, Lachaud, Thibert 2014), which the paper takes for digital objects:
space within R, averaged within r. Of the height map (heights rounded to a tenth of a step) what leans up to 60°.
)";

constexpr const char* kHoledHow = R"(
A bent tube of voxels, whole and with holes: balls of 1.5 voxels radius taken out of it at random
(`bench/scans/holed_tube.cpp`). *Thinning* is a curve skeleton by simple points (`bench/scans/thinning.cpp`). It keeps the body's topology,
so every hole that runs through makes a loop and every one inside a shell; a clean line is one piece with two ends. Its
error is that of its voxels. *Ours* is told nothing; its pieces are the tubes found, its error that of the longest one, the
length found that of all of them over the true one.
)";

struct Options {
  AboutRun about;
  std::string page, picture;
  std::uint64_t first_seed = 1;
  int tubes = 1000;
  double largest = 1e7;
};

void write_page(const Options& options, const std::string& text) {
  if (options.page.empty()) {
    fmt::print("{}", text);
    return;
  }
  std::ofstream file(options.page);
  file << text;
  if (!file.flush()) throw std::runtime_error(options.page + ": can't be written");
}

void run_bends(const Options& options) {
  const BendStudy full = study_bends(options.first_seed, options.tubes, false);
  const BendStudy one_side = study_bends(options.first_seed, options.tubes, true);
  std::string text = page_head("Bends of random tubes in static scans", options.about);
  text += fmt::format("{} tubes, of seeds {} and on. ✓ and ✗ say whether a figure meets its goal.\n\n{}{}",
                      options.tubes, options.first_seed, bend_table_text(full, one_side), kBendsHow);
  for (const BendStudy* study : {&full, &one_side}) {
    if (study->wrong.empty()) continue;
    text +=
        fmt::format("\nWhose number of bends was wrong, {}:\n\n", study == &full ? "of full scans" : "from one side");
    for (const std::string& line : study->wrong) text += fmt::format("- {}\n", line);
  }
  write_page(options, text);
}

void run_paper(const Options& options) {
  // Growing scans first: a process of its own starts with the memory of this one.
  std::vector<PaperRow> growth, paper, robustness;
  for (double faces = 1e4; faces <= 1.001 * options.largest; faces *= std::sqrt(10.0))
    growth.push_back(measure_alone(static_cast<std::size_t>(faces)));
  for (const PaperScan& scan : paper_scans(1.0)) paper.push_back(measure(scan, true));
  for (const PaperScan& scan : robustness_scans(1.0)) robustness.push_back(measure(scan, false));
  std::string text = page_head("Static scans like the paper's", options.about);
  text +=
      "✓ and ✗ say whether a figure meets its goal: accuracy as the table says, and our seconds a hundredth of the "
      "transcription's or of the paper's.\n\n";
  text += paper_rows_text(paper) + kPaperHow;
  text += "\n## Robustness\n\nAs in the paper's figure of accumulation images.\n\n" + robustness_text(robustness);
  text += "\n## Beside thinning\n\nAs in the paper's figure 2.\n\n" + holed_tubes_text() + kHoledHow;
  if (!options.picture.empty()) {
    if (const auto written = write_holed_tube_picture(options.picture); !written)
      throw std::runtime_error(written.error().message);
    text += "\n![The holed tube's voxels, a thinning skeleton of it, and the centreline found](img/thinning.png)\n";
    text +=
        "\n*Left the tube with 5 % of it holes, in the middle its skeleton by thinning, right the centreline found.*\n";
  }
  text += "\n## Normals of voxels and height maps\n\n" + normal_table_text() + kNormalsHow;
  text +=
      "\n## Growth\n\nA full mesh, lengthened; radius and grid step stay. Each size in a process of "
      "its own, whose peak memory that is, with the scan.\n\n";
  text += growth_text(growth);
  write_page(options, text);
}

int run_command_line(int argc, char** argv) {
  Options options;
  CLI::App app{"Benchmarks of static scans."};
  app.require_subcommand(1);
  CLI::App* bends = app.add_subcommand("bends", "bends of random tubes, of full scans and of scans from one side");
  bends->add_option("--first-seed", options.first_seed, "of the tubes (default: 1)");
  bends->add_option("--tubes", options.tubes, "how many (default: 1000)")->check(CLI::Range(1, 100000));
  CLI::App* paper = app.add_subcommand("paper", "scans like the paper's, against its own algorithms transcribed");
  paper->add_option("--largest", options.largest, "faces of the largest growing scan (default: 1e7)")
      ->check(CLI::Range(1e4, 1e8));
  paper->add_option("--picture", options.picture, "write the picture beside thinning to this PNG (default: none)");
  CLI::App* holes = app.add_subcommand("holes", "the paper page's table beside thinning alone");
  holes->add_option("--picture", options.picture, "as for paper");
  CLI::App* normals = app.add_subcommand("normals", "the paper page's table of normals alone");
  for (CLI::App* command : {bends, paper}) {
    command->add_option("--page", options.page, "write the page to this file (default: print it)");
    command->add_option("--command", options.about.command, "for the page: the command that makes it");
    command->add_option("--commit", options.about.commit, "for the page");
    command->add_option("--cpu", options.about.cpu, "for the page");
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  if (bends->parsed()) run_bends(options);
  if (paper->parsed()) run_paper(options);
  if (holes->parsed()) {
    fmt::print("{}{}", holed_tubes_text(), kHoledHow);
    if (options.picture.empty()) return 0;
    if (const auto written = write_holed_tube_picture(options.picture); !written)
      throw std::runtime_error(written.error().message);
  }
  if (normals->parsed()) fmt::print("{}{}", normal_table_text(), kNormalsHow);
  return 0;
}

}  // namespace
}  // namespace tubetrack::bench

int main(int argc, char** argv) {
  try {
    return tubetrack::bench::run_command_line(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "scan_suite: %s\n", problem.what());
    return 1;
  }
}
