#include <fmt/format.h>

#include <memory>
#include <optional>

#include "commands.hpp"
#include "device.hpp"
#include "track_options.hpp"
#include "tubetrack/replay/recorder.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {

namespace {

constexpr const char* kFooter =
    R"(DEVICE is an URI that `tubetrack devices` lists; the first device if left out. A run that can't keep up drops the
oldest frame and counts it ("dropped" in the lines). Ctrl-C ends it.

Without a sensor, any recording can be the device (docs/live.md):
  scripts/virtual-device RECORDING tubetrack live

Examples:
  tubetrack live > tubes.jsonl
  tubetrack live --radius 0.0125 --record desk/
  tubetrack live --intrinsics 575.8,575.8,314.5,235.5 --frames 0:300

Exit codes: 0 done or ended by Ctrl-C, 1 it failed while running (no device, device lost), 2 wrong usage.)";

struct LiveOptions {
  std::string device;
  std::string record;
  std::string deadline_ms;
  TrackOptions track;
  RecordingFlags reading;
};

/// The settings for this device: its own noise model where it is a known one, unless --config or --noise say another.
Expected<TrackerConfig> config_for_device(const TrackOptions& options, const StreamInfo& info) {
  TrackerConfig defaults;
  const auto of_device = noise_model_of_device(info.device);
  if (of_device) defaults.noise = *of_device;
  auto config = tracker_config_from(options, defaults);
  if (config && !options.quiet) {
    const char* why = !options.noise.empty()    ? "as --noise says"
                      : !options.config.empty() ? "by --config and the device"
                      : of_device               ? "by the device's name"
                                                : "the default: this device's is not known, --noise says it";
    fmt::print(stderr, "note: noise model {} for {} ({})\n", config->noise.name, info.device, why);
  }
  return config;
}

Expected<int> live(const LiveOptions& options) {
  auto config = tracker_config_from(options.track);
  if (!config) return tl::make_unexpected(config.error());
  if (options.track.print_config) {
    fmt::print("{}", config_text(*config));
    return 0;
  }
  if (!options.deadline_ms.empty()) {
    return tl::make_unexpected(Error::usage("--deadline-ms: is not in this version; leave it out"));
  }
  const auto reading = recording_options_from(options.reading);
  if (!reading) return tl::make_unexpected(reading.error());
  const auto source = open_device(options.device, *reading);
  if (!source) return tl::make_unexpected(source.error());
  const StreamInfo& info = (*source)->info();
  if (!options.track.quiet) fmt::print(stderr, "note: {}\n", device_note(info, *reading));
  config = config_for_device(options.track, info);
  if (!config) return tl::make_unexpected(config.error());
  auto tracker = create_tracker(*config, info.intrinsics);
  if (!tracker) return tl::make_unexpected(tracker.error());
  RunOptions run = run_options_from(options.track, *config);
  run.realtime = true;
  run.interrupted_exit_code = 0;
  std::optional<Recorder> recorder;
  if (!options.record.empty()) {
    auto created = Recorder::create(options.record, info);
    if (!created) return tl::make_unexpected(created.error());
    recorder = std::move(*created);
    run.on_frame = [&recorder](const DepthFrame& frame) { return recorder->write(frame); };
  }
  return run_tracker(**source, *tracker, run);
}

}  // namespace

void add_live(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<LiveOptions>();
  CLI::App* command = app.add_subcommand("live", "follow the tubes that an OpenNI2 depth camera sees");
  command->footer(kFooter);
  command->add_option("DEVICE", options->device, "the device to open");
  add_tracker_flags(*command, options->track);
  add_recording_flags(*command, options->reading);
  command->add_option("--record", options->record, "also record the frames into this folder")->type_name("PATH");
  command->add_option("--deadline-ms", options->deadline_ms, "not in this version")->type_name("T");
  add_output_flags(*command, options->track);
  command->callback([options, &exit_code] {
    const auto code = live(*options);
    exit_code = code ? *code : report_error(code.error());
  });
}

}  // namespace tubetrack
