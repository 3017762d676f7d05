// The benchmarks of static scans.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <fstream>
#include <stdexcept>

#include "bend_study.hpp"
#include "page_head.hpp"

namespace tubetrack::bench {
namespace {

constexpr const char* kBendsHow = R"(
Each tube has 1 to 6 bends of 30° to 180° in planes turned at random, bend radii of 1.5 to 10 diameters, straights of 1
to 6 diameters, a radius of 4 to 15 mm (`bench/scans/random_tubes.cpp`), and is a mesh of 6 to 10 grid steps a radius
whose points err by 1 % of the radius (σ) along the surface's normal. "From one side" leaves the faces that look toward a viewer who
sees the tube lying: half of every section. Nothing is told to the search, not even the radius. The errors are of the
tubes whose number of bends is right; a straight at an end goes to where the surface ends.
)";

struct Options {
  AboutRun about;
  std::string page;
  std::uint64_t first_seed = 1;
  int tubes = 200;
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

int run_command_line(int argc, char** argv) {
  Options options;
  CLI::App app{"Benchmarks of static scans."};
  app.require_subcommand(1);
  CLI::App* bends = app.add_subcommand("bends", "bends of random tubes, of full scans and of scans from one side");
  bends->add_option("--first-seed", options.first_seed, "of the tubes (default: 1)");
  bends->add_option("--tubes", options.tubes, "how many (default: 200)")->check(CLI::Range(1, 100000));
  for (CLI::App* command : {bends}) {
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
