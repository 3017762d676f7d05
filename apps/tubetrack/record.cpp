#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "device.hpp"
#include "kept_files.hpp"
#include "oni_check.hpp"
#include "run.hpp"
#include "tubetrack/replay/recorder.hpp"

namespace tubetrack {

namespace {

constexpr const char* kRecordFooter =
    R"(Writes the frames of a device as a recording, until Ctrl-C or the end of --frames: into a folder in TUM form, bit for
bit, readable at every moment up to its last frame; or, where PATH ends in .oni, into a file of OpenNI2's. That format is
compressed and not bit exact for every image, and a recorder that is killed leaves a file that nothing can read; so it is
read back at the end, and what differs is counted.
A device that is unplugged, or silent, is waited for; an .oni goes on in a new file (desk-2.oni).

Examples:
  tubetrack record desk/
  tubetrack record 1d27/0600@1/5 desk/ --frames 0:300
  tubetrack record desk.oni

Exit codes: 0 done or ended by Ctrl-C, 1 it failed while running (no device, disk full), 2 wrong usage.)";

constexpr std::chrono::milliseconds kDevicePatience{100};  ///< how long Ctrl-C may have to wait for a silent device

struct RecordOptions {
  std::vector<std::string> positional;  ///< [DEVICE] PATH
  DeviceFlags flags;
  bool quiet = false;
};

/// Where the frames go: one of the two.
struct Target {
  std::optional<Recorder> folder;
  std::optional<OniCheck> oni;
};

struct Counts {
  std::int64_t frames = 0;
  std::int64_t corrupt = 0;
};

Expected<void> write(Target& target, const DepthFrame& frame) {
  if (target.folder) return target.folder->write(frame);
  if (target.oni) target.oni->add(frame);
  return {};
}

/// Until the end of the range or Ctrl-C.
Expected<void> record_frames(FrameSource& source, Target& target, bool quiet, Counts& counts) {
  DepthFrame frame;
  while (!interrupted()) {
    const FrameOutcome outcome = source.next(frame, kDevicePatience);
    if (const std::string note = source.take_note(); !note.empty() && !quiet) fmt::print(stderr, "note: {}\n", note);
    if (outcome == FrameOutcome::end_of_stream) break;
    if (outcome == FrameOutcome::corrupt) ++counts.corrupt;
    if (outcome == FrameOutcome::device_lost) {
      if (target.oni) target.oni->next_piece();
      if (!quiet) {
        fmt::print(stderr, "note: {}: {}; the {} frames before are recorded; waiting for it to be back\n",
                   source.info().name, source.last_problem(), counts.frames);
      }
    }
    if (outcome != FrameOutcome::ok) continue;
    if (auto written = write(target, frame); !written) return written;
    ++counts.frames;
  }
  return {};
}

Expected<Target> open_target(const std::filesystem::path& path, bool oni, const StreamInfo& info) {
  Target target;
  if (oni) {
    target.oni.emplace(path);
    return target;
  }
  auto recorder = Recorder::create(path, info);
  if (!recorder) return tl::make_unexpected(recorder.error());
  target.folder = std::move(*recorder);
  return target;
}

Expected<void> record(const RecordOptions& options) {
  const std::filesystem::path path = options.positional.back();
  if (auto kept = keep_others("PATH", path.string()); !kept) return kept;
  DeviceFlags flags = options.flags;
  const bool oni = path.extension() == ".oni";
  if (oni) flags.record_oni = path;
  auto source = open_device(options.positional.size() == 2 ? options.positional.front() : "", flags);
  if (!source) return tl::make_unexpected(source.error());
  const std::string name = (*source)->info().name;
  auto target = open_target(path, oni, (*source)->info());
  if (!target) return tl::make_unexpected(target.error());
  if (!options.quiet) fmt::print(stderr, "note: {}\n", device_note((*source)->info(), flags));
  catch_interrupts();
  hurry_when_interrupted();
  Counts counts;
  auto recorded = record_frames(**source, *target, options.quiet, counts);
  const std::int64_t dropped = (*source)->dropped();
  source->reset();  // closes the file
  no_hurry();
  if (!options.quiet) {
    fmt::print(stderr, "{}: {} frames recorded, {} dropped, {} corrupt\n", path.string(), counts.frames, dropped,
               counts.corrupt);
  }
  if (recorded && counts.frames == 0 && !interrupted()) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: not one frame came", name)));
  }
  std::optional<OniCheck>& file = target->oni;
  if (!recorded || !file || counts.frames == 0) return recorded;
  const auto checked = file->read_back();
  if (!checked) return tl::make_unexpected(checked.error());
  if (!options.quiet) fmt::print(stderr, "{}\n", *checked);
  return {};
}

}  // namespace

void add_record(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<RecordOptions>();
  CLI::App* command = app.add_subcommand("record", "record the frames of a live depth camera");
  command->footer(kRecordFooter);
  command
      ->add_option("PATH", options->positional,
                   "the folder, or the .oni file, to record to; before it, the device to open")
      ->required()
      ->expected(1, 2)
      ->type_name("[DEVICE] PATH");
  add_device_flags(*command, options->flags);
  command->add_flag("--quiet", options->quiet, "no notes and no summary on stderr; errors only");
  command->callback([options, &exit_code] {
    const auto done = record(*options);
    exit_code = done ? 0 : report_error(done.error());
  });
}

}  // namespace tubetrack
