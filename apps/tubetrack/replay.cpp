#include <fmt/format.h>

#include <memory>

#include "commands.hpp"
#include "track_options.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {

namespace {

constexpr const char* kFooter =
    R"(RECORDING is a folder in TUM form (depth.txt, camera_info.yaml, and groundtruth.txt where the camera moves), a bare
folder of 16-bit PNG, TIFF or PGM images, a BOP scene, or an OpenNI2 file (.oni).

Results: one JSON object a frame and line, keys in docs/output.schema.json. Exit codes: 0 done, 1 it failed while
running, 2 wrong usage, 130 ended by Ctrl-C (the lines written so far are whole).

Examples:
  tubetrack replay desk/ > tubes.jsonl
  tubetrack replay desk/ --radius 0.0125 --out tubes.jsonl --overlay pictures/
  tubetrack replay images/ --intrinsics 525,525,319.5,239.5 --depth-scale 0.001
  tubetrack replay desk/ --frames 100:200 --pace realtime --view)";

struct ReplayOptions {
  std::string recording;
  TrackOptions track;
  RecordingFlags reading;
};

Expected<int> replay(const ReplayOptions& options) {
  auto config = config_for_recording(options.track, options.recording);
  if (!config) return tl::make_unexpected(config.error());
  if (options.track.print_config) {
    fmt::print("{}", config_text(*config));
    return 0;
  }
  auto reading = recording_options_from(options.reading);
  if (!reading) return tl::make_unexpected(reading.error());
  if (options.recording.empty())
    return tl::make_unexpected(Error::usage("replay: give the RECORDING to follow tubes in"));
  auto recording = open_recording(options.recording, *reading);
  if (!recording) return tl::make_unexpected(recording.error());
  if (!options.track.quiet) {
    for (const std::string& note : recording->notes) fmt::print(stderr, "note: {}\n", note);
  }
  auto tracker = create_tracker(*config, recording->source->info().intrinsics);
  if (!tracker) return tl::make_unexpected(tracker.error());
  RunOptions run = run_options_from(options.track, *config);
  run.realtime = reading->pace == Pace::realtime;
  return run_tracker(*recording->source, *tracker, run);
}

}  // namespace

void add_replay(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<ReplayOptions>();
  CLI::App* command = app.add_subcommand("replay", "follow the tubes of a recording, frame by frame");
  command->footer(kFooter);
  command->add_option("RECORDING", options->recording, "the recording to read");
  add_tracker_flags(*command, options->track);
  add_recording_flags(*command, options->reading);
  command
      ->add_option(
          "--pace", options->reading.pace,
          "fast: every frame, as quickly as it goes (default); realtime: as recorded, dropping what is too late")
      ->type_name("fast|realtime");
  add_output_flags(*command, options->track);
  command->callback([options, &exit_code] {
    const auto code = replay(*options);
    exit_code = code ? *code : report_error(code.error());
  });
}

}  // namespace tubetrack
