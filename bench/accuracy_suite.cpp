// The accuracy benchmark: random scenes from seeds, rendered in memory, tracked, and compared with the truth.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "plain_table.hpp"
#include "run.hpp"

namespace tubetrack::bench {
namespace {

constexpr const char* kFooter = R"(Examples:
  accuracy_suite --row bent --count 10          single frames of ten scenes
  accuracy_suite --row hand --count 0 --sequences 2
  accuracy_suite --list)";

/// No scene of one suite is in the other: look at `tuning` as much as you like, never at `held-out` while tuning.
constexpr std::uint64_t kTuningSeed = 1;
constexpr std::uint64_t kHeldOutSeed = 1000001;

struct Options {
  std::vector<std::string> rows;
  std::string suite = "tuning";
  std::uint64_t first = 0;
  int count = 5;
  int sequences = 0;
  int random = -1;
  bool list = false;
};

void list_rows() {
  for (const Row& row : rows()) fmt::print("{:14} {}\n", row.name, row.shows);
}

std::vector<Row> chosen_rows(const Options& options) {
  std::vector<Row> chosen;
  for (const Row& row : rows()) {
    if (options.rows.empty() || std::ranges::count(options.rows, row.name) > 0) chosen.push_back(row);
  }
  return chosen;
}

RunOptions run_options(const Options& options, const Row& row) {
  RunOptions run;
  run.first_seed = (options.suite == "held-out" ? kHeldOutSeed : kTuningSeed) + options.first;
  run.single_scenes = row.single_shots && options.random >= 0 ? options.random : options.count;
  run.sequences = options.sequences;
  return run;
}

void run(const Options& options) {
  const std::vector<Method> methods = {tubetrack_method()};
  fmt::print("{}", plain_header());
  const bool terminal = isatty(STDERR_FILENO) != 0;
  for (const Row& row : chosen_rows(options)) {
    int done = 0;
    const auto progress = [&] {
      if (terminal) fmt::print(stderr, "{}: {} scenes\r", row.name, ++done);
    };
    const std::vector<RowResult> results = run_row(row, methods, run_options(options, row), progress);
    for (const RowResult& result : results) {
      if (result.single.frames > 0) fmt::print("{}", plain_line(row.name, "single", result.single));
      if (result.sequence.frames > 0) fmt::print("{}", plain_line(row.name, "sequence", result.sequence));
      if (result.last.frames > 0) fmt::print("{}", plain_line(row.name, "last", result.last));
    }
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace tubetrack::bench

int main(int argc, char** argv) {
  using namespace tubetrack::bench;
  Options options;
  CLI::App app{"Random scenes with known tubes: how accurate the tracker is, how sure, how fast."};
  app.footer(kFooter);
  std::vector<std::string> names;
  for (const Row& row : rows()) names.emplace_back(row.name);
  app.add_option("--row", options.rows, "only these rows (--list)")->check(CLI::IsMember(names));
  app.add_option("--suite", options.suite, "seeds: those to tune on, or those that are reported (default: tuning)")
      ->check(CLI::IsMember({"tuning", "held-out"}));
  app.add_option("--count", options.count, "scenes a row, of which a single frame is scored (default: 5)")
      ->check(CLI::Range(0, 100000));
  app.add_option("--random", options.random, "the same for the row `random` (default: as --count)")
      ->check(CLI::Range(0, 100000));
  app.add_option("--sequences", options.sequences, "scenes a row that are followed for 30 frames (default: 0)")
      ->check(CLI::Range(0, 10000));
  app.add_option("--first", options.first, "start at this scene of the suite (default: 0)")
      ->check(CLI::Range(0, 400000));
  app.add_flag("--list", options.list, "list the rows");
  CLI11_PARSE(app, argc, argv);
  try {
    options.list ? list_rows() : run(options);
  } catch (const std::exception& problem) {
    fmt::print(stderr, "accuracy_suite: {}\n", problem.what());
    return 1;
  }
  return 0;
}
