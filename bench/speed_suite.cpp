// The speed benchmark: scenes rendered in memory, tracked in turns with a floor pass and with the peers.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <fstream>
#include <stdexcept>

#include "speed_page.hpp"
#include "speed_peers.hpp"
#include "speed_run.hpp"

namespace tubetrack::bench {
namespace {

struct Options {
  SpeedOptions speed;
  SpeedAbout about;
  std::string page;
};

void add_options(CLI::App& app, Options& options) {
  app.add_option("--frames", options.speed.frames, "timed, of each row; p99 wants 1000 (default: 1000)")
      ->check(CLI::Range(1, 1000000));
  app.add_option("--distinct", options.speed.distinct, "frames rendered for a row, played forth and back (default: 60)")
      ->check(CLI::Range(2, 1000));
  app.add_option("--first-frames", options.speed.first_frames, "first frames timed of each scene (default: 60)")
      ->check(CLI::Range(1, 100000));
  app.add_option("--slow-every", options.speed.slow_every, "PCL, CGAL and SRI get one frame in so many (default: 40)")
      ->check(CLI::Range(1, 100000));
  app.add_option("--row-seconds", options.speed.row_seconds,
                 "a row ends then, with fewer frames (default: 40; with the slow peers twice that)")
      ->check(CLI::PositiveNumber);
  app.add_option("--page", options.page, "write the page to this file (default: print it)");
  app.add_option("--peak-memory-mb", options.about.peak_memory_mb, "for the page: what track_alone printed")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--command", options.about.command, "for the page: the command that makes it");
  app.add_option("--commit", options.about.commit, "for the page");
  app.add_option("--cpu", options.about.cpu, "for the page");
}

int run_command_line(int argc, char** argv) {
  Options options;
  CLI::App app{"How fast the tracker is, beside a floor pass and beside its peers."};
  add_options(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  const SpeedReport report =
      run_speed(options.speed, speed_peers, [](const std::string& what) { fmt::print(stderr, "{}\n", what); });
  const std::string text = speed_page(report, options.about);
  if (options.page.empty()) {
    fmt::print("{}", text);
    return 0;
  }
  std::ofstream file(options.page);
  file << text;
  if (!file.flush()) throw std::runtime_error(options.page + ": can't be written");
  return 0;
}

}  // namespace
}  // namespace tubetrack::bench

int main(int argc, char** argv) {
  try {
    return tubetrack::bench::run_command_line(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "speed_suite: %s\n", problem.what());
    return 1;
  }
}
