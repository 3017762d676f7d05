#include <fmt/format.h>

#include <memory>

#include "commands.hpp"
#include "flag_values.hpp"
#include "kept_files.hpp"
#include "plane_run.hpp"
#include "track_options.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {

namespace {

constexpr const char* kReplayFooter =
    R"(RECORDING is a folder in TUM form (depth.txt, camera_info.yaml, and groundtruth.txt where the camera moves), a bare
folder of 16-bit PNG, TIFF or PGM images, a BOP scene, or an OpenNI2 file (.oni).

Results: one JSON object a frame and line, keys in docs/output.schema.json. Exit codes: 0 done, 1 it failed while
running, 2 wrong usage, 130 ended by Ctrl-C (the lines written so far are whole).

Examples:
  tubetrack replay desk/ > tubes.jsonl
  tubetrack replay desk/ --radius 0.0125 --out tubes.jsonl --overlay pictures/
  tubetrack replay images/ --intrinsics 525,525,319.5,239.5 --depth-scale 0.001
  tubetrack replay desk/ --frames 100:200 --pace realtime --view
  tubetrack replay hoses/ --varying-radius
  tubetrack replay around/ --map plane --save-heightmap table.png)";

struct ReplayOptions {
  std::string recording, map, save_heightmap, cell_size;
  TrackOptions track;
  RecordingFlags reading;
};

Expected<PlaneRunOptions> plane_options_from(const ReplayOptions& options, const TrackerConfig& config) {
  PlaneRunOptions plane;
  const bool asked = options.map == "plane";
  if (!asked && !options.map.empty() && options.map != "image")
    return malformed("--map", options.map, "image or plane");
  if (!asked && !(options.save_heightmap.empty() && options.cell_size.empty()))
    return tl::make_unexpected(Error::usage("--save-heightmap, --cell-size: belong to --map plane; give that as well"));
  if (asked && !options.track.overlay.empty())
    return tl::make_unexpected(Error::usage("--overlay: is drawn a frame, and --map plane has one result; give one"));
  if (asked && !options.track.deadline_ms.empty())
    return tl::make_unexpected(
        Error::usage("--deadline-ms: is a frame's, and --map plane has one result; give one of the two"));
  if (asked && config.varying_radius)
    return tl::make_unexpected(Error::usage("--varying-radius: is not looked for with --map plane; give one"));
  if (!options.cell_size.empty()) {
    const auto cell_m = number_from<double>(options.cell_size);
    if (!cell_m || *cell_m < 1e-4 || *cell_m > 0.1)
      return malformed("--cell-size", options.cell_size, "metres, 0.0001 to 0.1, like 0.002");
    plane.cell_size_m = *cell_m;
  }
  if (!options.save_heightmap.empty() && !options.save_heightmap.ends_with(".png"))
    return malformed("--save-heightmap", options.save_heightmap, "a name that ends in .png");
  plane.save_heightmap = options.save_heightmap;
  plane.out = options.track.out;
  plane.any_radius = options.track.radius_range.empty() && !config.radius_m;
  plane.with_timing = !options.track.no_timing;
  plane.strict = options.track.strict;
  plane.quiet = options.track.quiet;
  auto nominal = nominal_check_from(options.track.nominal, options.track.out);
  if (!nominal) return tl::make_unexpected(nominal.error());
  plane.nominal = std::move(*nominal);
  return plane;
}

Expected<int> replay(const ReplayOptions& options) {
  auto config = config_for_recording(options.track, options.recording);
  if (!config) return tl::make_unexpected(config.error());
  if (options.track.print_config) {
    fmt::print("{}", config_text(*config));
    return 0;
  }
  const bool plane = options.map == "plane";
  auto plane_options = plane_options_from(options, *config);
  if (!plane_options) return tl::make_unexpected(plane_options.error());
  auto reading = recording_options_from(options.reading);
  if (!reading) return tl::make_unexpected(reading.error());
  if (options.recording.empty())
    return tl::make_unexpected(Error::usage("replay: give the RECORDING to follow tubes in"));
  if (auto kept = keep_recording(options.recording, options.track.out, options.track.overlay, options.save_heightmap);
      !kept)
    return tl::make_unexpected(kept.error());
  auto recording = open_recording(options.recording, *reading);
  if (!recording) return tl::make_unexpected(recording.error());
  if (!options.track.quiet) {
    for (const std::string& note : recording->notes) fmt::print(stderr, "note: {}\n", note);
  }
  if (plane) return run_plane_map(*recording->source, *config, *plane_options);
  auto tracker = create_tracker(*config, recording->source->info().intrinsics);
  if (!tracker) return tl::make_unexpected(tracker.error());
  auto run = run_options_from(options.track, *config);
  if (!run) return tl::make_unexpected(run.error());
  run->realtime = reading->pace == Pace::realtime;
  return run_tracker(*recording->source, *tracker, *run);
}

}  // namespace

void add_replay(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<ReplayOptions>();
  CLI::App* command = app.add_subcommand("replay", "follow the tubes of a recording, frame by frame");
  command->footer(kReplayFooter);
  command->add_option("RECORDING", options->recording, "the recording to read");
  add_tracker_flags(*command, options->track);
  add_recording_flags(*command, options->reading);
  add_deadline_flag(*command, options->track);
  command
      ->add_option(
          "--pace", options->reading.pace,
          "fast: every frame, as quickly as it goes (default); realtime: as recorded, dropping what is too late")
      ->type_name("fast|realtime");
  command
      ->add_option(
          "--map", options->map,
          "image (the default): the tubes of every frame; plane: all frames fused into one map of heights over "
          "the largest plane, and the tubes of that map, in one line at the end")
      ->type_name("image|plane");
  command
      ->add_option("--save-heightmap", options->save_heightmap,
                   "with --map plane: write the heights as a 16-bit PNG, and a .json beside it, for `tubetrack scan`")
      ->type_name("FILE.png");
  command->add_option("--cell-size", options->cell_size, "with --map plane: metres a cell; if left out, a pixel's size")
      ->type_name("M");
  add_output_flags(*command, options->track);
  command->callback([options, &exit_code] {
    const auto code = replay(*options);
    exit_code = code ? *code : report_error(code.error());
  });
}

}  // namespace tubetrack
