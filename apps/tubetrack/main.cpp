#include <fmt/format.h>

#include <exception>

#include "commands.hpp"
#include "parse_problem.hpp"

namespace {

constexpr const char* kHelp =
    R"(tubetrack follows tubes, pipes, hoses and cables in the stream of a depth camera: for every frame it says where each
tube's centreline runs and how thick the tube is. All lengths are in metres.)";

constexpr const char* kMainFooter = R"(Start with:  tubetrack replay RECORDING --overlay pictures/ > tubes.jsonl
Each command explains itself:  tubetrack replay --help)";

int run(int argc, char** argv) {
  CLI::App app(kHelp, "tubetrack");
  int exit_code = 0;
  app.set_version_flag("--version", std::string("tubetrack ") + TUBETRACK_VERSION, "print the version and end");
  app.footer(kMainFooter);
  app.require_subcommand(0, 1);
  tubetrack::add_replay(app, exit_code);
  tubetrack::add_live(app, exit_code);
  tubetrack::add_record(app, exit_code);
  tubetrack::add_devices(app, exit_code);
  tubetrack::add_eval(app, exit_code);
  tubetrack::add_synth(app, exit_code);
  tubetrack::add_calibrate_noise(app, exit_code);
  tubetrack::add_scan(app, exit_code);
  tubetrack::add_tile(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& problem) {
    fmt::print(stderr, "tubetrack: {}\n", tubetrack::parse_problem(app, problem));
    return 2;
  }
  if (app.get_subcommands().empty()) {
    fmt::print(stderr, "{}", app.help());
    return 2;
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    fmt::print(stderr, "tubetrack: {}\n", problem.what());
    return 1;
  }
}
