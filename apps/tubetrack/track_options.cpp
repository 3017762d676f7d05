#include "track_options.hpp"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "flag_values.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {

namespace {

std::string hint_without_tubes(const TrackerConfig& config) {
  const std::string time =
      config.deadline_ms
          ? fmt::format("; {:g} ms a frame (deadline) may be too short to look for one", *config.deadline_ms)
          : "";
  if (config.radius_m) {
    return fmt::format("no tube of radius {:g} m was found; leave --radius out to see which there are{}",
                       *config.radius_m, time);
  }
  return fmt::format(
      "no tube of radius {:g} to {:g} m was found; one is at least 8 pixels wide and {:g} radii long, and seen over "
      "90° of its section{}",
      config.radius_min_m, config.radius_max_m, config.min_length_radii, time);
}

Expected<void> apply_radius(const TrackOptions& options, TrackerConfig& config) {
  constexpr std::string_view kRadiusForm = "the tube's radius in metres, above 0, like 0.02";
  constexpr std::string_view kRangeForm = "MIN:MAX in metres, 0 < MIN < MAX, like 0.01:0.05";
  if (!options.radius.empty() && !options.radius_range.empty()) {
    return tl::make_unexpected(Error::usage("--radius and --radius-range: give one of the two"));
  }
  if (!options.radius.empty()) {
    const auto radius = number_from<double>(options.radius);
    if (!radius || *radius <= 0.0) return malformed("--radius", options.radius, kRadiusForm);
    config.radius_m = radius;
  }
  if (!options.radius_range.empty()) {
    const auto range = numbers_from<double, 2>(options.radius_range, ':');
    if (!range || (*range)[0] <= 0.0 || (*range)[1] <= (*range)[0]) {
      return malformed("--radius-range", options.radius_range, kRangeForm);
    }
    config.radius_min_m = (*range)[0];
    config.radius_max_m = (*range)[1];
    config.radius_m.reset();
  }
  if (options.varying_radius) {
    if (config.radius_m)
      return tl::make_unexpected(Error::usage(
          "--varying-radius: a known radius is held; leave --radius (radius_m) out, or give --radius-range"));
    config.varying_radius = true;
  }
  return {};
}

Expected<void> apply_noise(const TrackOptions& options, TrackerConfig& config) {
  if (options.noise.empty()) return {};
  auto model = noise_model_from(options.noise);
  if (!model) return tl::make_unexpected(model.error());
  config.noise = std::move(*model);
  return {};
}

Expected<void> apply_view(const TrackOptions& options, TrackerConfig& config) {
  if (!options.depth_range.empty()) {
    const auto range = numbers_from<double, 2>(options.depth_range, ':');
    if (!range || (*range)[0] < 0.0 || (*range)[1] <= (*range)[0]) {
      return malformed("--depth-range", options.depth_range, "MIN:MAX in metres, 0 ≤ MIN < MAX, like 0.3:2.5");
    }
    config.depth_min_m = (*range)[0];
    config.depth_max_m = (*range)[1];
  }
  if (!options.roi.empty()) {
    const auto roi = numbers_from<int, 4>(options.roi, ',');
    if (!roi || (*roi)[0] < 0 || (*roi)[1] < 0 || (*roi)[2] <= 0 || (*roi)[3] <= 0) {
      return malformed("--roi", options.roi, "u,v,w,h in pixels, u and v ≥ 0, w and h > 0, like 100,80,320,240");
    }
    std::tie(config.roi_u_px, config.roi_v_px, config.roi_width_px, config.roi_height_px) =
        std::tuple((*roi)[0], (*roi)[1], (*roi)[2], (*roi)[3]);
  }
  return {};
}

Expected<void> apply_machine(const TrackOptions& options, TrackerConfig& config) {
  if (!options.threads.empty()) {
    const auto threads = number_from<int>(options.threads);
    if (!threads || *threads < 1) return malformed("--threads", options.threads, "a whole number from 1 to 16");
    config.threads = *threads;
  }
  if (!options.deadline_ms.empty()) {
    config.deadline_ms = number_from<double>(options.deadline_ms);
    if (!config.deadline_ms) return malformed("--deadline-ms", options.deadline_ms, "milliseconds, like 20");
  }
  return {};
}

/// Names of fields within a message.
std::string in_words(std::string message) {
  const std::pair<std::string_view, std::string_view> words[] = {
      {"radius_min_m", "MIN"}, {"depth_min_m", "MIN"}, {"depth_max_m", "the depths that are looked at"}};
  for (const auto& [field, word] : words) {
    if (const std::size_t at = message.find(field); at != std::string::npos) message.replace(at, field.size(), word);
  }
  return message;
}

/// validate() names fields of the configuration; who typed a flag wants to read the flag.
std::string with_flag_name(const TrackOptions& options, const std::string& message) {
  const std::pair<std::string_view, std::pair<std::string_view, const std::string*>> flags[] = {
      {"radius_m:", {"--radius", &options.radius}},
      {"radius_min_m:", {"--radius-range", &options.radius_range}},
      {"radius_max_m:", {"--radius-range", &options.radius_range}},
      {"depth_min_m:", {"--depth-range", &options.depth_range}},
      {"depth_max_m:", {"--depth-range", &options.depth_range}},
      {"roi", {"--roi", &options.roi}},
      {"threads:", {"--threads", &options.threads}},
      {"deadline_ms:", {"--deadline-ms", &options.deadline_ms}}};
  for (const auto& [field, flag] : flags) {
    if (message.starts_with(field) && !flag.second->empty()) {
      return fmt::format("{} {}: {}", flag.first, *flag.second, in_words(message.substr(message.find(' ') + 1)));
    }
  }
  return message;
}

}  // namespace

void add_tracker_flags(CLI::App& command, TrackOptions& options) {
  command.add_option("--radius", options.radius, "the tubes' radius in metres, where it is known; found if left out")
      ->type_name("M");
  command.add_option("--radius-range", options.radius_range, "look for radii in this range only, in metres")
      ->type_name("MIN:MAX");
  command.add_flag("--varying-radius", options.varying_radius,
                   "let the radius vary along a tube, as a hose's or a branch's does: node_radius_m in the results");
  command.add_option("--depth-range", options.depth_range, "ignore what is nearer or farther, in metres")
      ->type_name("MIN:MAX");
  command.add_option("--roi", options.roi, "look only at this part of the image, in pixels")->type_name("U,V,W,H");
  command
      .add_option("--noise", options.noise,
                  "the sensor's noise: kinect1, stereo, tof, synthetic, or a file of `tubetrack calibrate-noise`")
      ->type_name("NAME|FILE");
  command
      .add_option("--threads", options.threads,
                  "threads that share the work on each frame, 1 to 16 (default: 1); results do not depend on it")
      ->type_name("N");
  command.add_option("--config", options.config, "settings from a JSON file; flags win over it")->type_name("FILE");
  command.add_flag("--print-config", options.print_config,
                   "print every setting as used, as JSON for --config, and end");
}

void add_deadline_flag(CLI::App& command, TrackOptions& options) {
  command
      .add_option(
          "--deadline-ms", options.deadline_ms,
          "a frame's time: when it is over, known tubes are followed still, new ones are left to the next frame")
      ->type_name("T");
}

void add_output_flags(CLI::App& command, TrackOptions& options) {
  add_nominal_flags(command, options.nominal);
  command.add_option("--out", options.out, "write the JSON lines here instead of to stdout")->type_name("FILE.jsonl");
  command.add_option("--overlay", options.overlay, "also write a picture a frame into this folder")->type_name("DIR");
  command.add_flag(
      "--view", options.view,
      "show the depth and the tubes in a window as they come; q, Esc or closing it ends the run as Ctrl-C");
  command.add_flag("--no-timing", options.no_timing, "leave times out of the lines: equal runs give equal bytes");
  command.add_flag("--strict", options.strict, "exit with 1 if a single frame was bad");
  command.add_flag("--quiet", options.quiet, "no progress, notes or summary on stderr; errors only");
}

Expected<NoiseModel> noise_model_from(const std::string& flag) {
  if (auto named = noise_model_by_name(flag)) return named;
  std::error_code ignored;
  if (flag.find_first_of("./") == std::string::npos && !std::filesystem::exists(flag, ignored)) {
    return malformed("--noise", flag, "kinect1, stereo, tof, synthetic or a JSON file");
  }
  auto read = read_noise_model(flag);
  if (!read) return tl::make_unexpected(Error::usage("--noise " + read.error().message));
  return read;
}

Expected<TrackerConfig> tracker_config_from(const TrackOptions& options, const TrackerConfig& defaults) {
  TrackerConfig config = defaults;
  if (!options.config.empty()) {
    auto read = read_config(options.config, defaults);
    if (!read) return tl::make_unexpected(Error::usage("--config " + read.error().message));
    config = std::move(*read);
  }
  for (auto* apply : {apply_radius, apply_view, apply_noise, apply_machine}) {
    if (auto applied = apply(options, config); !applied) return tl::make_unexpected(applied.error());
  }
  if (auto valid = validate(config); !valid) {
    return tl::make_unexpected(Error::usage(with_flag_name(options, valid.error().message)));
  }
  return config;
}

Expected<TrackerConfig> config_for_recording(const TrackOptions& options, const std::string& recording) {
  const std::filesystem::path file = std::filesystem::path(recording) / "noise.json";
  std::error_code ignored;
  if (recording.empty() || !options.noise.empty() || !std::filesystem::exists(file, ignored))
    return tracker_config_from(options);
  auto own = read_noise_model(file);
  if (!own) return tl::make_unexpected(own.error());
  TrackerConfig defaults;
  defaults.noise = std::move(*own);
  auto config = tracker_config_from(options, defaults);
  if (config && !options.quiet)
    fmt::print(stderr, "note: noise model {} ({})\n", config->noise.name,
               options.config.empty() ? file.string() : "by --config and the recording");
  return config;
}

Expected<TubeTracker> create_tracker(const TrackerConfig& config, const Intrinsics& intrinsics) {
  const bool inside = config.roi_u_px + config.roi_width_px <= intrinsics.width &&
                      config.roi_v_px + config.roi_height_px <= intrinsics.height;
  if (inside) return TubeTracker::create(config, intrinsics);
  return tl::make_unexpected(Error::usage(
      fmt::format("--roi {},{},{},{}: reaches beyond the image; takes u,v,w,h within {} x {} pixels", config.roi_u_px,
                  config.roi_v_px, config.roi_width_px, config.roi_height_px, intrinsics.width, intrinsics.height)));
}

Expected<RunOptions> run_options_from(const TrackOptions& options, const TrackerConfig& config) {
  RunOptions run;
  auto nominal = nominal_check_from(options.nominal, options.out);
  if (!nominal) return tl::make_unexpected(nominal.error());
  run.nominal = std::move(*nominal);
  run.hint_without_tubes = hint_without_tubes(config);
  run.out = options.out;
  run.overlay_dir = options.overlay;
  run.view = options.view;
  run.with_timing = !options.no_timing;
  run.strict = options.strict;
  run.quiet = options.quiet;
  run.smallest_radius_m = config.radius_m.value_or(config.radius_min_m);
  return run;
}

void add_recording_flags(CLI::App& command, RecordingFlags& flags) {
  command.add_option("--frames", flags.frames, "only frames A to B−1, counted from 0; A or B may be left out")
      ->type_name("A:B");
  command
      .add_option("--intrinsics", flags.intrinsics,
                  "the camera, in pixels, where the recording does not say (of a device also a camera_info.yaml)")
      ->type_name("FX,FY,CX,CY");
  command.add_option("--depth-scale", flags.depth_scale, "metres of one depth unit: 0.001 for millimetres")
      ->type_name("S");
}

Expected<RecordingOptions> recording_options_from(const RecordingFlags& flags) {
  RecordingOptions options;
  if (!flags.frames.empty()) {
    constexpr std::string_view kForm = "A:B with 0 ≤ A < B, half open, like 0:100, 50: or :20";
    const std::size_t colon = flags.frames.find(':');
    if (colon == std::string::npos) return malformed("--frames", flags.frames, kForm);
    const std::string begin = flags.frames.substr(0, colon);
    const std::string end = flags.frames.substr(colon + 1);
    const auto first = begin.empty() ? std::optional<std::int64_t>(0) : number_from<std::int64_t>(begin);
    const auto last = end.empty() ? std::optional<std::int64_t>() : number_from<std::int64_t>(end);
    if (!first || *first < 0 || (!end.empty() && (!last || *last <= *first))) {
      return malformed("--frames", flags.frames, kForm);
    }
    options.frames = {*first, last};
  }
  if (!flags.intrinsics.empty()) {
    const auto intrinsics = numbers_from<double, 4>(flags.intrinsics, ',');
    if (!intrinsics || (*intrinsics)[0] <= 0.0 || (*intrinsics)[1] <= 0.0) {
      return malformed("--intrinsics", flags.intrinsics,
                       "fx,fy,cx,cy in pixels, fx and fy > 0, like 525,525,319.5,239.5");
    }
    options.intrinsics_px = *intrinsics;
  }
  if (!flags.depth_scale.empty()) {
    const auto scale = number_from<double>(flags.depth_scale);
    if (!scale || *scale <= 0.0) {
      return malformed("--depth-scale", flags.depth_scale, "metres of one depth unit, above 0, like 0.001");
    }
    options.metres_per_unit = scale;
  }
  if (flags.pace == "realtime") {
    options.pace = Pace::realtime;
  } else if (!flags.pace.empty() && flags.pace != "fast") {
    return malformed("--pace", flags.pace, "fast or realtime");
  }
  return options;
}

}  // namespace tubetrack
