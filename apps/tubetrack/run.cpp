#include "run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

#include "feed.hpp"
#include "live_status.hpp"
#include "progress.hpp"
#include "tubetrack/report/overlay.hpp"
#include "tubetrack/report/scan_json.hpp"
#include "tubetrack/report/summary.hpp"
#include "view.hpp"

namespace tubetrack {

namespace {

/// The result lines' way out: stdout or a file, each line flushed whole.
class LineWriter {
 public:
  static Expected<LineWriter> open(const std::filesystem::path& path) {
    LineWriter writer;
    if (path.empty()) return writer;
    writer.name_ = path.string();
    writer.file_.reset(std::fopen(path.c_str(), "w"));
    if (writer.file_) return writer;
    return tl::make_unexpected(Error::usage(
        fmt::format("--out {}: {}; give a file in an existing folder", path.string(), std::strerror(errno))));
  }

  Expected<void> write(std::string line) {
    line += '\n';
    std::FILE* const file = file_ ? file_.get() : stdout;
    if (std::fwrite(line.data(), 1, line.size(), file) == line.size() && std::fflush(file) == 0) {
      ++lines_;
      return {};
    }
    return tl::make_unexpected(
        Error::failed(fmt::format("{}: {}; {} lines were written whole", name_, std::strerror(errno), lines_)));
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::unique_ptr<std::FILE, Close> file_;
  std::string name_ = "stdout";
  std::int64_t lines_ = 0;
};

Expected<void> check_radius(double radius_m, const DepthFrame& frame, const std::string& name) {
  const double depth_m = median_depth_m(frame);
  if (radius_m <= 0.0 || depth_m <= 0.0 || radius_m < depth_m) return {};
  return tl::make_unexpected(Error::usage(
      fmt::format("radius {:g} m: larger than the scene, {} is {:.2f} m away (median); give metres, like --radius 0.02",
                  radius_m, name, depth_m)));
}

struct Run {
  FrameSource& source;
  TubeTracker& tracker;
  const RunOptions& options;
  LineWriter writer;
  Feed feed;
  Progress progress;
  LiveStatus status;
  View* view;  ///< none without --view
  RunSummary summary;
  std::vector<NominalComparison> nominal = {};  ///< of each nominal tube, in the last frame that shows it
  bool radius_checked = false;
  bool lost = false;            ///< and not back yet
  std::int64_t highest_id = 0;  ///< of all tubes so far
  std::int64_t ids_before = 0;  ///< of trackers before this one
};

/// Once per loss: it may be weeks until somebody reads this.
Expected<void> lose_device(Run& run, const std::string& why) {
  const std::string text = fmt::format("{}: {}", run.source.info().name, why.empty() ? "lost" : why);
  if (!run.options.survive_loss) {
    return tl::make_unexpected(
        Error::failed(fmt::format("{}; the {} frames before are written", text, run.summary.frames)));
  }
  run.status.lost(run.summary);
  run.lost = true;
  if (!run.options.quiet) fmt::print(stderr, "note: {}; waiting for it to be back\n", text);
  return {};
}

Expected<void> welcome_back(Run& run) {
  run.lost = false;
  if (!run.options.quiet) {
    fmt::print(stderr, "note: {}: is back; {}\n", run.source.info().name,
               run.options.fresh_tracker ? "tracking starts anew" : "its map and tubes were kept");
  }
  if (!run.options.fresh_tracker) return {};
  auto tracker = run.options.fresh_tracker();
  if (!tracker) return tl::make_unexpected(tracker.error());
  run.tracker = std::move(*tracker);
  run.ids_before = run.highest_id;
  return {};
}

void number_tubes(Run& run, TubeFrame& result) {
  for (Tube& tube : result.tubes) {
    tube.id += run.ids_before;
    run.highest_id = std::max(run.highest_id, tube.id);
  }
}

/// Tubes that are seen now against the nominal ones.
std::vector<NominalComparison> compare(Run& run, const TubeFrame& result) {
  if (run.options.nominal.tubes.empty()) return {};
  std::vector<Tube> seen;
  std::ranges::copy_if(result.tubes, std::back_inserter(seen),
                       [](const Tube& tube) { return tube.state == TubeState::tracked; });
  std::vector<NominalComparison> compared = compare_with_nominal(run.options.nominal.tubes, seen);
  run.nominal.resize(compared.size());
  for (std::size_t i = 0; i < compared.size(); ++i) {
    const bool first = run.nominal[i].points.empty();
    if (first || compared[i].problem.empty()) run.nominal[i] = compared[i];
  }
  return compared;
}

Expected<void> handle(Run& run, const QueuedFrame& item) {
  const StreamInfo& info = run.source.info();
  if (item.outcome == FrameOutcome::ok && !std::exchange(run.radius_checked, true)) {
    if (auto fits = check_radius(run.options.smallest_radius_m, item.frame, info.name); !fits) return fits;
  }
  if (run.lost && item.outcome == FrameOutcome::ok) {
    if (auto back = welcome_back(run); !back) return back;
  }
  TubeFrame result = track_or_explain(item.outcome, item.frame, item.problem, info, run.tracker);
  number_tubes(run, result);
  result.dropped = run.feed.dropped();
  add_frame(run.summary, result);
  const std::vector<NominalComparison> compared = compare(run, result);
  const std::string line =
      line_with_findings(result, run.options.with_timing, {{}, compared, run.options.nominal.tolerance_m});
  if (auto written = run.writer.write(line); !written) return written;
  if (item.outcome == FrameOutcome::ok) run.status.add(item.frame, run.summary);
  if (!run.options.overlay_dir.empty() && item.frame.pixels != nullptr) {
    const auto path = run.options.overlay_dir / fmt::format("{:06}.png", result.frame);
    if (auto written = write_overlay(path, item.frame, info.intrinsics, result); !written) return written;
  }
  if (run.view != nullptr && item.frame.pixels != nullptr) run.view->show(item.frame, result);
  run.progress.show(run.summary.frames, fmt::format("tubes {}  bad {}  dropped {}", run.summary.tubes.size(),
                                                    bad_frames(run.summary), run.summary.dropped));
  return {};
}

void tell_notes(Run& run) {
  for (const std::string& note : run.feed.take_notes()) {
    run.progress.clear();
    if (!run.options.quiet) fmt::print(stderr, "note: {}\n", note);
  }
}

void tell_status(Run& run) {
  if (const auto line = run.status.line_if_due(run.summary)) {
    run.progress.clear();
    fmt::print(stderr, "{}\n", *line);
  }
}

/// Until the end of the stream or Ctrl-C.
Expected<void> loop(Run& run) {
  while (!interrupted()) {
    auto item = run.feed.next();
    if (!item) return tl::make_unexpected(item.error());
    tell_notes(run);
    tell_status(run);
    if (item->outcome == FrameOutcome::timeout) continue;
    if (item->outcome == FrameOutcome::end_of_stream) return {};
    if (item->outcome == FrameOutcome::device_lost) {
      if (auto survived = lose_device(run, item->problem); !survived) return survived;
      continue;
    }
    if (auto handled = handle(run, *item); !handled) return handled;
  }
  return {};
}

int exit_code_of(const Run& run) {
  const std::int64_t bad = bad_frames(run.summary);
  if (interrupted()) return run.options.interrupted_exit_code;
  const std::string& name = run.source.info().name;
  if (run.summary.frames == 0) return report_error(Error::failed(fmt::format("{}: not one frame came", name)));
  if (bad == run.summary.frames) {
    return report_error(
        Error::failed(fmt::format("{}: all {} frames are bad, see \"error\" in their lines", name, bad)));
  }
  if (run.options.strict && bad > 0) {
    return report_error(
        Error::failed(fmt::format("{}: --strict, and {} of {} frames are bad", name, bad, run.summary.frames)));
  }
  return 0;
}

Expected<void> make_folder(const std::filesystem::path& path) {
  std::error_code problem;
  std::filesystem::create_directories(path, problem);
  if (!problem && std::filesystem::is_directory(path)) return {};
  return tl::make_unexpected(Error::usage(fmt::format("--overlay {}: {}; give a folder that can be made and written",
                                                      path.string(), problem ? problem.message() : "is no folder")));
}

}  // namespace

int report_error(const Error& error) {
  fmt::print(stderr, "tubetrack: {}\n", error.message);
  return error.kind == Error::Kind::usage ? 2 : 1;
}

double median_depth_m(const DepthFrame& frame) {
  std::vector<std::uint16_t> values;
  for (int v = 0; frame.pixels != nullptr && v < frame.height; v += 4) {
    for (int u = 0; u < frame.width; u += 4) {
      if (frame.row(v)[u] != 0) values.push_back(frame.row(v)[u]);
    }
  }
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle * frame.metres_per_unit;
}

TubeFrame track_or_explain(FrameOutcome outcome, const DepthFrame& frame, const std::string& problem,
                           const StreamInfo& info, TubeTracker& tracker) {
  if (outcome == FrameOutcome::ok && !frame.pose_missing) {
    const auto start = std::chrono::steady_clock::now();
    TubeFrame result = tracker.track(frame);
    result.latency_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    return result;
  }
  TubeFrame result;
  result.frame = frame.index;
  result.timestamp_s = frame.timestamp_s;
  result.frame_id = info.has_poses ? "world" : "camera";
  result.status = outcome == FrameOutcome::ok ? TrackStatus::no_pose : TrackStatus::corrupt;
  result.problem = outcome == FrameOutcome::ok
                       ? fmt::format("no pose within 20 ms of {:.6f} s in groundtruth.txt", frame.timestamp_s)
                       : problem;
  return result;
}

int run_tracker(FrameSource& source, TubeTracker& tracker, const RunOptions& options) {
  auto writer = LineWriter::open(options.out);
  if (!writer) return report_error(writer.error());
  if (!options.overlay_dir.empty()) {
    if (auto made = make_folder(options.overlay_dir); !made) return report_error(made.error());
  }
  std::unique_ptr<View> view;
  if (options.view) {
    auto opened = View::open("tubetrack: " + source.info().name, source.info().intrinsics);
    if (!opened) return report_error(opened.error());
    view = std::move(*opened);
  }
  catch_interrupts();
  Run run{source,
          tracker,
          options,
          std::move(*writer),
          {source, options},
          {options.quiet, source.info().frame_count},
          LiveStatus(options.status_every_s),
          view.get(),
          {}};
  const auto ended = loop(run);
  run.progress.clear();
  run.summary.live.device_dropped = run.feed.dropped_by_source();
  if (!options.quiet && run.summary.frames > 0) fmt::print(stderr, "{}", summary_text(run.summary));
  if (!options.quiet) print_nominal(run.nominal);
  if (!options.quiet && run.summary.frames > 0 && run.summary.frames_with_tubes == 0)
    fmt::print(stderr, "note: {}\n", options.hint_without_tubes);
  if (!ended) return report_error(ended.error());
  if (const int code = exit_code_of(run); code != 0) return code;
  const auto judged = judge_nominal(source.info().name, run.nominal, options.nominal.tolerance_m);
  return judged ? 0 : report_error(judged.error());
}

}  // namespace tubetrack
