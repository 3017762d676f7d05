#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "device.hpp"
#include "track_options.hpp"
#include "tubetrack/replay/recorder.hpp"

namespace tubetrack {

namespace {

constexpr const char* kFooter =
    R"(Writes the frames of a device as a recording in TUM form, bit for bit, until Ctrl-C or the end of --frames. What was
written so far is readable at every moment: tubetrack replay PATH.

Examples:
  tubetrack record desk/
  tubetrack record 1d27/0600@1/5 desk/ --frames 0:300

Exit codes: 0 done or ended by Ctrl-C, 1 it failed while running (no device, disk full), 2 wrong usage.)";

constexpr std::chrono::milliseconds kPatience{100};  ///< how long Ctrl-C may have to wait for a silent device

struct RecordOptions {
  std::vector<std::string> positional;  ///< [DEVICE] PATH
  RecordingFlags reading;
  bool quiet = false;
};

/// Until the end of the range or Ctrl-C; the number of corrupt frames passed over.
Expected<std::int64_t> record_frames(FrameSource& source, Recorder& recorder) {
  std::int64_t corrupt = 0;
  DepthFrame frame;
  while (!interrupted()) {
    const FrameOutcome outcome = source.next(frame, kPatience);
    if (outcome == FrameOutcome::end_of_stream) break;
    if (outcome == FrameOutcome::corrupt) ++corrupt;
    if (outcome == FrameOutcome::device_lost) {
      return tl::make_unexpected(
          Error::failed(fmt::format("{}: {}; the {} frames before are recorded", source.info().name,
                                    source.last_problem(), recorder.frames_written())));
    }
    if (outcome != FrameOutcome::ok) continue;
    if (auto written = recorder.write(frame); !written) return tl::make_unexpected(written.error());
  }
  return corrupt;
}

Expected<void> record(const RecordOptions& options) {
  const auto reading = recording_options_from(options.reading);
  if (!reading) return tl::make_unexpected(reading.error());
  const std::string& path = options.positional.back();
  const auto source = open_device(options.positional.size() == 2 ? options.positional.front() : "", *reading);
  if (!source) return tl::make_unexpected(source.error());
  auto recorder = Recorder::create(path, (*source)->info());
  if (!recorder) return tl::make_unexpected(recorder.error());
  if (!options.quiet) fmt::print(stderr, "note: {}\n", device_note((*source)->info(), *reading));
  catch_interrupts();
  const auto corrupt = record_frames(**source, *recorder);
  if (!options.quiet) {
    fmt::print(stderr, "{}: {} frames recorded, {} dropped, {} corrupt\n", path, recorder->frames_written(),
               (*source)->dropped(), corrupt.value_or(0));
  }
  if (!corrupt) return tl::make_unexpected(corrupt.error());
  if (recorder->frames_written() == 0 && !interrupted()) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: not one frame came", (*source)->info().name)));
  }
  return {};
}

}  // namespace

void add_record(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<RecordOptions>();
  CLI::App* command = app.add_subcommand("record", "record the frames of an OpenNI2 depth camera");
  command->footer(kFooter);
  command->add_option("PATH", options->positional, "the folder to record to; before it, the device to open")
      ->required()
      ->expected(1, 2)
      ->type_name("[DEVICE] PATH");
  add_recording_flags(*command, options->reading);
  command->add_flag("--quiet", options->quiet, "no notes and no summary on stderr; errors only");
  command->callback([options, &exit_code] {
    const auto done = record(*options);
    exit_code = done ? 0 : report_error(done.error());
  });
}

}  // namespace tubetrack
