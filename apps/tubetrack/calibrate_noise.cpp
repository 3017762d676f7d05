#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>

#include "commands.hpp"
#include "track_options.hpp"
#include "tubetrack/replay/noise_calibration.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {

namespace {

constexpr const char* kCalibrateNoiseFooter =
    R"(RECORDING is a still scene seen by a camera at rest, 10 frames or more, better 100: walls, boxes and a floor at all the
depths that matter, some of them seen at a slant. How much each pixel's depth varies over time, by depth and by slant,
gives the model; docs/noise.md has its formula. What the recording cannot tell is kept from --noise, and a note says so.

The model is written as JSON to --out or stdout; a table of measured and modelled sigma goes to stderr.

Examples:
  tubetrack record still/ --frames 0:100
  tubetrack calibrate-noise still/ --out my-sensor.json
  tubetrack replay desk/ --noise my-sensor.json

Exit codes: 0 done; 1 something moved, too few frames or pixels, or unreadable data; 2 wrong usage.)";

struct CalibrateOptions {
  std::string recording, out, noise;
  RecordingFlags reading;
  bool quiet = false;
};

/// All good frames of the recording; corrupt ones are counted.
Expected<PixelHistory> watch(FrameSource& source, std::int64_t& corrupt) {
  PixelHistory history;
  DepthFrame frame;
  catch_interrupts();
  while (!interrupted()) {
    const FrameOutcome outcome = source.next(frame, std::chrono::milliseconds(100));
    if (outcome == FrameOutcome::end_of_stream) break;
    if (outcome == FrameOutcome::device_lost)
      return tl::make_unexpected(Error::failed(fmt::format("{}: {}", source.info().name, source.last_problem())));
    if (outcome == FrameOutcome::corrupt) ++corrupt;
    if (outcome != FrameOutcome::ok) continue;
    if (auto added = add_frame(history, frame); !added) return tl::make_unexpected(added.error());
  }
  return history;
}

std::string table_text(const NoiseCalibration& calibration) {
  std::string text = fmt::format("{:>13} {:>9} {:>17} {:>14} {:>7}\n", "depth m", "pixels", "measured sigma mm",
                                 "model sigma mm", "ratio");
  for (const NoiseTableRow& row : calibration.rows) {
    text += fmt::format("{:>6.2f}-{:<6.2f} {:>9} {:>17.3f} {:>14.3f} {:>7.3f}\n", row.depth_from_m, row.depth_to_m,
                        row.pixels, 1e3 * row.measured_m, 1e3 * row.model_m, row.measured_m / row.model_m);
  }
  return text;
}

Expected<void> write_model(const NoiseModel& model, const std::string& path) {
  if (path.empty()) {
    fmt::print("{}", noise_model_text(model));
    return {};
  }
  if (auto written = write_noise_model(model, path); !written) {
    return tl::make_unexpected(
        Error::usage(fmt::format("--out {}; give a file in an existing folder", written.error().message)));
  }
  return {};
}

Expected<void> calibrate(const CalibrateOptions& options) {
  const auto start = noise_model_from(options.noise.empty() ? "kinect1" : options.noise);
  if (!start) return tl::make_unexpected(start.error());
  const auto reading = recording_options_from(options.reading);
  if (!reading) return tl::make_unexpected(reading.error());
  auto recording = open_recording(options.recording, *reading);
  if (!recording) return tl::make_unexpected(recording.error());
  const auto note = [&options](const std::string& text) {
    if (!options.quiet) fmt::print(stderr, "note: {}\n", text);
  };
  for (const std::string& text : recording->notes) note(text);
  std::int64_t corrupt = 0;
  const auto history = watch(*recording->source, corrupt);
  if (!history) return tl::make_unexpected(history.error());
  if (corrupt > 0) note(fmt::format("{} corrupt frame(s) are left out", corrupt));
  auto calibration = calibrate_noise(*history, recording->source->info().intrinsics, *start);
  if (!calibration) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: {}", options.recording, calibration.error().message)));
  }
  calibration->model.name =
      options.out.empty() ? std::string("calibrated") : std::filesystem::path(options.out).stem().string();
  if (auto written = write_model(calibration->model, options.out); !written) return written;
  for (const std::string& text : calibration->notes) note(text);
  if (!options.quiet) fmt::print(stderr, "{}", table_text(*calibration));
  return {};
}

}  // namespace

void add_calibrate_noise(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<CalibrateOptions>();
  CLI::App* command =
      app.add_subcommand("calibrate-noise", "find a sensor's noise model from a recording of a still scene");
  command->footer(kCalibrateNoiseFooter);
  command->add_option("RECORDING", options->recording, "a recording of a still scene, camera at rest")->required();
  add_recording_flags(*command, options->reading);
  command->add_option("--noise", options->noise, "the model to start from, kinect1 if left out")
      ->type_name("NAME|FILE");
  command->add_option("--out", options->out, "write the model here instead of to stdout")->type_name("FILE");
  command->add_flag("--quiet", options->quiet, "no notes and no table on stderr; errors only");
  command->callback([options, &exit_code] {
    const auto done = calibrate(*options);
    exit_code = done ? (interrupted() ? 130 : 0) : report_error(done.error());
  });
}

}  // namespace tubetrack
