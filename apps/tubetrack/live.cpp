#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "commands.hpp"
#include "device.hpp"
#include "flag_values.hpp"
#include "kept_files.hpp"
#include "track_options.hpp"
#include "tubetrack/replay/recorder.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {

namespace {

constexpr const char* kLiveFooter =
    R"(DEVICE is an URI that `tubetrack devices` lists; the first OpenNI2 device if left out. `libcamera` is the first camera
of libcamera's, for depth that comes as grey values: it needs --depth-scale and --intrinsics. A run that can't keep up
drops the oldest frame and counts it ("dropped" in the lines). A device that is unplugged, or silent, is waited for and
opened again. Ctrl-C ends the run.

Without a sensor, any recording can be the device (docs/live.md):
  scripts/virtual-device RECORDING tubetrack live

Examples:
  tubetrack live > tubes.jsonl
  tubetrack live --radius 0.0125 --record desk/
  tubetrack live --intrinsics 575.8,575.8,314.5,235.5 --frames 0:300
  tubetrack live libcamera --depth-scale 0.001 --intrinsics my-camera.yaml
  tubetrack live --on-reconnect keep --status-every 60      a camera that stays where it is, for months

Exit codes: 0 done or ended by Ctrl-C, 1 it failed while running (no device; lost, with --on-reconnect stop), 2 wrong usage.)";

struct LiveOptions {
  std::string device;
  std::string record;
  std::string status_every;
  TrackOptions track;
  DeviceFlags flags;
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

/// 0 where the flag is not given.
Expected<double> status_every_from(const std::string& text) {
  if (text.empty()) return 0.0;
  const auto seconds = number_from<double>(text);
  if (!seconds || *seconds <= 0.0) return malformed("--status-every", text, "seconds above 0, like 60");
  return *seconds;
}

Expected<int> live(const LiveOptions& options) {
  auto config = tracker_config_from(options.track);
  if (!config) return tl::make_unexpected(config.error());
  if (options.track.print_config) {
    fmt::print("{}", config_text(*config));
    return 0;
  }
  const auto status_every_s = status_every_from(options.status_every);
  if (!status_every_s) return tl::make_unexpected(status_every_s.error());
  auto run = run_options_from(options.track, *config);
  if (!run) return tl::make_unexpected(run.error());
  if (auto kept = keep_others("--record", options.record); !kept) return tl::make_unexpected(kept.error());
  DeviceFlags flags = options.flags;
  const bool to_oni = std::filesystem::path(options.record).extension() == ".oni";
  if (to_oni) flags.record_oni = options.record;
  const auto source = open_device(options.device, flags);
  if (!source) return tl::make_unexpected(source.error());
  const StreamInfo& info = (*source)->info();
  if (!options.track.quiet) fmt::print(stderr, "note: {}\n", device_note(info, flags));
  config = config_for_device(options.track, info);
  if (!config) return tl::make_unexpected(config.error());
  auto tracker = create_tracker(*config, info.intrinsics);
  if (!tracker) return tl::make_unexpected(tracker.error());
  run->realtime = true;
  run->interrupted_exit_code = 0;
  run->status_every_s = *status_every_s;
  run->survive_loss = flags.reconnects();
  if (flags.on_reconnect == "reset") {
    run->fresh_tracker = [&config, &info] { return create_tracker(*config, info.intrinsics); };
  }
  std::optional<Recorder> recorder;
  if (!options.record.empty() && !to_oni) {
    auto created = Recorder::create(options.record, info);
    if (!created) return tl::make_unexpected(created.error());
    recorder = std::move(*created);
    run->on_frame = [&recorder](const DepthFrame& frame) { return recorder->write(frame); };
  }
  hurry_when_interrupted();
  const int exit_code = run_tracker(**source, *tracker, *run);
  if (recorder && !options.track.quiet)
    fmt::print(stderr, "{}: {} frames recorded\n", options.record, recorder->frames_written());
  return exit_code;
}

}  // namespace

void add_live(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<LiveOptions>();
  CLI::App* command = app.add_subcommand("live", "follow the tubes that a live depth camera sees");
  command->footer(kLiveFooter);
  command->add_option("DEVICE", options->device, "the device to open");
  add_tracker_flags(*command, options->track);
  add_device_flags(*command, options->flags);
  command
      ->add_option(
          "--on-reconnect", options->flags.on_reconnect,
          "when the device is back after a loss: track anew (reset, the default), or go on with the map and the "
          "tubes (keep: the camera has not moved); stop: a loss ends the run")
      ->type_name("reset|keep|stop");
  command
      ->add_option("--record", options->record,
                   "also record the frames: into this folder, or, where it ends in .oni, into this file")
      ->type_name("PATH");
  command
      ->add_option("--status-every", options->status_every,
                   "a line on stderr so often: frames, drops, latency from capture to result, jitter")
      ->type_name("SECONDS");
  add_deadline_flag(*command, options->track);
  add_output_flags(*command, options->track);
  command->callback([options, &exit_code] {
    const auto code = live(*options);
    exit_code = code ? *code : report_error(code.error());
  });
}

}  // namespace tubetrack
