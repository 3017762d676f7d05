// The accuracy benchmark: random scenes from seeds, rendered in memory, tracked, and compared with the truth.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "ablation.hpp"
#include "methods.hpp"
#include "page.hpp"
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
  int ablation = 0;
  int jobs = 1;
  double bound_piece = 1.0;
  bool peers = false;
  bool list = false;
  std::string page;
  std::string intervals;
  About about;
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

std::uint64_t first_seed(const Options& options) {
  return (options.suite == "held-out" ? kHeldOutSeed : kTuningSeed) + options.first;
}

RunOptions run_options(const Options& options, const Row& row) {
  RunOptions run;
  run.first_seed = first_seed(options);
  run.single_scenes = row.single_shots && options.random >= 0 ? options.random : options.count;
  run.sequences = options.sequences;
  run.jobs = options.jobs;
  run.bound_piece_radii = 2.0 * options.bound_piece;
  return run;
}

/// Counts scenes on a terminal; says nothing elsewhere.
std::function<void()> progress_of(std::string_view what) {
  if (isatty(STDERR_FILENO) == 0) return [] {};
  return [what, done = 0]() mutable { fmt::print(stderr, "{}: {} scenes\r", what, ++done); };
}

void print_lines(std::string_view row, std::string_view method, const RowResult& result) {
  for (const auto& [what, figures] :
       {std::pair{"single", &result.single}, {"sequence", &result.sequence}, {"last", &result.last}}) {
    if (figures->frames == 0) continue;
    fmt::print("{}", plain_line(row, method == "tubetrack" ? what : method, *figures));
  }
  std::fflush(stdout);
}

std::vector<Method> methods_of(const Options& options) {
  std::vector<Method> methods = {tubetrack_method()};
  if (!options.peers) return methods;
  for (Method& peer : peer_methods()) methods.push_back(std::move(peer));
  if (methods.size() == 1) {
    throw std::runtime_error(
        "--peers: this program was built without them; install libpcl-dev and libcgal-dev, configure with "
        "-DTUBETRACK_PEERS=ON");
  }
  return methods;
}

void write_page(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  if (!file.flush()) throw std::runtime_error(path + ": can't be written");
}

void run(const Options& options) {
  const std::vector<Method> methods = methods_of(options);
  Report report;
  report.about = options.about;
  report.about.suite = options.suite;
  report.about.first_seed = first_seed(options);
  report.about.bound_piece_diameters = options.bound_piece;
  report.about.jobs = options.jobs;
  for (const Method& method : methods) report.methods.push_back(method.name);
  fmt::print("{}", plain_header());
  for (const Row& row : chosen_rows(options)) {
    report.rows.push_back({row, run_row(row, methods, run_options(options, row), progress_of(row.name))});
    for (std::size_t i = 0; i < methods.size(); ++i)
      print_lines(row.name, methods[i].name, report.rows.back().by_method[i]);
  }
  if (options.ablation > 0) {
    report.ablation = run_ablation(options.ablation, first_seed(options), options.jobs, progress_of("noise in parts"));
    for (const AblationStep& step : report.ablation) fmt::print("{}", plain_line(step.noise, "single", step.figures));
  }
  if (!options.page.empty()) write_page(options.page, page(report));
  if (!options.intervals.empty()) write_page(options.intervals, intervals_page(report));
}

void add_options(CLI::App& app, Options& options) {
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
  app.add_option("--ablation", options.ablation,
                 "also with parts of the noise switched off: scenes a step (default: 0)")
      ->check(CLI::Range(0, 10000));
  app.add_option("--jobs", options.jobs,
                 "scenes at the same time; more than one makes the times worthless (default: 1)")
      ->check(CLI::Range(1, 256));
  app.add_option("--bound-piece", options.bound_piece,
                 "piece of centreline the Cramer-Rao bound is for, in tube diameters (default: 1)")
      ->check(CLI::Range(0.1, 100.0));
  app.add_option("--first", options.first, "start at this scene of the suite (default: 0)")
      ->check(CLI::Range(0, 400000));
  app.add_flag("--peers", options.peers, "run PCL and CGAL on the same single frames, where built in");
  app.add_flag("--list", options.list, "list the rows");
  app.add_option("--page", options.page, "also write the tables in Markdown to this file");
  app.add_option("--intervals", options.intervals, "also write how far the intervals hold, in Markdown, to this file");
  app.add_option("--command", options.about.command, "for the page: the command that makes it");
  app.add_option("--commit", options.about.commit, "for the page");
  app.add_option("--cpu", options.about.cpu, "for the page");
}

int run_command_line(int argc, char** argv) {
  Options options;
  CLI::App app{"Random scenes with known tubes: how accurate the tracker is, how sure, how fast."};
  app.footer(kFooter);
  add_options(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  options.list ? list_rows() : run(options);
  return 0;
}

}  // namespace
}  // namespace tubetrack::bench

int main(int argc, char** argv) {
  try {
    return tubetrack::bench::run_command_line(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "accuracy_suite: %s\n", problem.what());
    return 1;
  }
}
