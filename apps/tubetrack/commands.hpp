#pragma once

#include <CLI/CLI.hpp>

namespace tubetrack {

// One subcommand each, in the file of its name. Its callback does the work and sets `exit_code`:
// 0 done, 1 failed while running, 2 wrong usage, 130 a replay ended by Ctrl-C.
void add_replay(CLI::App& app, int& exit_code);
void add_eval(CLI::App& app, int& exit_code);
void add_live(CLI::App& app, int& exit_code);
void add_record(CLI::App& app, int& exit_code);
void add_devices(CLI::App& app, int& exit_code);
void add_synth(CLI::App& app, int& exit_code);
void add_calibrate_noise(CLI::App& app, int& exit_code);
void add_scan(CLI::App& app, int& exit_code);
void add_tile(CLI::App& app, int& exit_code);

}  // namespace tubetrack
