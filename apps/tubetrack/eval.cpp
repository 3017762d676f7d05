#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <memory>

#include "commands.hpp"
#include "track_options.hpp"
#include "tubetrack/replay/tube_truth.hpp"
#include "tubetrack/report/result_json.hpp"
#include "tubetrack/report/score.hpp"

namespace tubetrack {

namespace {

constexpr const char* kEvalFooter =
    R"(The score, for each true tube and for all: coverage (visible centreline that was found), RMS (distance of the reported
line to the true one), false length (reported line that is no tube), radius error (median), how much of the truth is in
the reported 95 % interval, IDF1 and identity switches (the true tube got another id) and transfers (the id went to
another true tube). Where tubes have bends: how many tables have as many, and how far these are off.

RECORDING needs its truth.jsonl beside it, as `tubetrack synth` writes it. Without TUBES.jsonl the recording is tracked
now, with the flags of `tubetrack replay`.

Examples:
  tubetrack eval desk/
  tubetrack eval desk/ tubes.jsonl --json
  tubetrack eval desk/ --radius 0.0125 --frames 0:30 --skip 5)";

struct EvalOptions {
  std::string recording;
  std::string results;
  std::string skip;
  bool json = false;
  TrackOptions track;
  RecordingFlags reading;
};

/// Tracks the whole recording; ends early on Ctrl-C.
Expected<std::vector<TubeFrame>> track_recording(const EvalOptions& options, const RecordingOptions& reading) {
  auto config = config_for_recording(options.track, options.recording);
  if (!config) return tl::make_unexpected(config.error());
  auto recording = open_recording(options.recording, reading);
  if (!recording) return tl::make_unexpected(recording.error());
  for (const std::string& note : recording->notes) fmt::print(stderr, "note: {}\n", note);
  FrameSource& source = *recording->source;
  auto tracker = create_tracker(*config, source.info().intrinsics);
  if (!tracker) return tl::make_unexpected(tracker.error());
  std::vector<TubeFrame> results;
  catch_interrupts();
  DepthFrame frame;
  while (!interrupted()) {
    const FrameOutcome outcome = source.next(frame, std::chrono::milliseconds(100));
    if (outcome == FrameOutcome::timeout) continue;
    if (outcome == FrameOutcome::end_of_stream) break;
    if (outcome == FrameOutcome::device_lost)
      return tl::make_unexpected(Error::failed(fmt::format("{}: {}", source.info().name, source.last_problem())));
    results.push_back(track_or_explain(outcome, frame, source.last_problem(), source.info(), *tracker));
  }
  return results;
}

/// Results from the file, or of a run made now; only the frames asked for.
Expected<std::vector<TubeFrame>> results_of(const EvalOptions& options) {
  auto reading = recording_options_from(options.reading);
  if (!reading) return tl::make_unexpected(reading.error());
  if (options.results.empty()) return track_recording(options, *reading);
  auto results = read_result_lines(options.results);
  if (!results) return results;
  std::erase_if(*results, [&](const TubeFrame& result) {
    return result.frame < reading->frames.begin || (reading->frames.end && result.frame >= *reading->frames.end);
  });
  return results;
}

Expected<void> evaluate(const EvalOptions& options) {
  ScoreRules rules;
  if (!options.skip.empty()) {
    const char* const end = options.skip.data() + options.skip.size();
    const auto read = std::from_chars(options.skip.data(), end, rules.first_frame);
    if (read.ptr != end || read.ec != std::errc() || rules.first_frame < 0) {
      return tl::make_unexpected(
          Error::usage(fmt::format("--skip {}: takes a number of frames, like 30", options.skip)));
    }
  }
  if (!std::filesystem::exists(options.recording)) {
    return tl::make_unexpected(
        Error::usage(fmt::format("{}: no such file or folder; give the folder of a recording", options.recording)));
  }
  const auto truth_path = std::filesystem::path(options.recording) / "truth.jsonl";
  if (!std::filesystem::exists(truth_path)) {
    return tl::make_unexpected(Error::failed(fmt::format(
        "{}: not found; a score needs the true tubes, make a recording that has them with `tubetrack synth`",
        truth_path.string())));
  }
  auto truth = read_truth(truth_path);
  if (!truth) return tl::make_unexpected(truth.error());
  auto results = results_of(options);
  if (!results) return tl::make_unexpected(results.error());
  auto score = score_run(*truth, *results, rules);
  if (!score) {
    const std::string& name = options.results.empty() ? options.recording : options.results;
    return tl::make_unexpected(Error{score.error().kind, fmt::format("{}: {}", name, score.error().message)});
  }
  fmt::print("{}", options.json ? score_json(*score) + "\n" : score_table(*score));
  return {};
}

}  // namespace

void add_eval(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<EvalOptions>();
  CLI::App* command = app.add_subcommand("eval", "score a run against the recording's true tubes");
  command->footer(kEvalFooter);
  command->add_option("RECORDING", options->recording, "a recording with its truth.jsonl")->required();
  command->add_option("TUBES.jsonl", options->results, "what `tubetrack replay --out` wrote; left out: track now");
  command->add_flag("--json", options->json, "one JSON object instead of a table; metres and fractions");
  command->add_option("--skip", options->skip, "do not score frames before number N; they are tracked all the same")
      ->type_name("N");
  add_tracker_flags(*command, options->track);
  add_recording_flags(*command, options->reading);
  command->callback([options, &exit_code] {
    const auto done = evaluate(*options);
    exit_code = done ? (interrupted() ? 130 : 0) : report_error(done.error());
  });
}

}  // namespace tubetrack
