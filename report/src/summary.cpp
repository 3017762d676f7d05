#include "tubetrack/report/summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "tubetrack/report/result_json.hpp"

namespace tubetrack {

namespace {

constexpr std::size_t kMaxTubesShown = 20;

/// A tube's totals take 4 kB: a run of months forgets those it hardly saw.
constexpr std::size_t kMostTubes = 1000;

constexpr std::pair<const char*, double StageTimes::*> kStages[] = {{"update", &StageTimes::update_ms},
                                                                    {"normals", &StageTimes::normals_ms},
                                                                    {"accumulate", &StageTimes::accumulate_ms},
                                                                    {"trace", &StageTimes::trace_ms},
                                                                    {"fit", &StageTimes::fit_ms},
                                                                    {"segment", &StageTimes::segment_ms}};

/// Down to half of what is kept, those seen in the fewest frames first, of these the oldest.
void forget_tubes(RunSummary& summary) {
  std::vector<std::pair<std::int64_t, std::int64_t>> by_frames;
  by_frames.reserve(summary.tubes.size());
  for (const auto& [id, totals] : summary.tubes) by_frames.emplace_back(totals.frames, id);
  std::sort(by_frames.begin(), by_frames.end());
  by_frames.resize(by_frames.size() - kMostTubes / 2);
  for (const auto& [frames, id] : by_frames) summary.tubes.erase(id);
  summary.tubes_forgotten += static_cast<std::int64_t>(by_frames.size());
}

void append_tubes(std::string& text, const RunSummary& summary) {
  std::vector<const std::pair<const std::int64_t, RunSummary::TubeTotals>*> tubes;
  tubes.reserve(summary.tubes.size());
  for (const auto& tube : summary.tubes) tubes.push_back(&tube);
  std::stable_sort(tubes.begin(), tubes.end(),
                   [](const auto* a, const auto* b) { return a->second.frames > b->second.frames; });
  auto out = std::back_inserter(text);
  fmt::format_to(out, "tubes {}{}\n", tubes.size() + static_cast<std::size_t>(summary.tubes_forgotten),
                 tubes.empty() ? "" : ", the longest seen first (medians):");
  if (tubes.empty()) return;
  fmt::format_to(out, "  {:>5} {:>10} {:>10} {:>8}  {}\n", "id", "radius mm", "length mm", "frames", "first-last");
  for (std::size_t i = 0; i < std::min(tubes.size(), kMaxTubesShown); ++i) {
    const auto& [id, totals] = *tubes[i];
    fmt::format_to(out, "  {:>5} {:>10.1f} {:>10.0f} {:>8}  {}-{}\n", id, totals.radius_m.at(0.5) * 1e3,
                   totals.length_m.at(0.5) * 1e3, totals.frames, totals.first_frame, totals.last_frame);
  }
  const auto more = static_cast<std::int64_t>(tubes.size()) - static_cast<std::int64_t>(kMaxTubesShown);
  if (more > 0) fmt::format_to(out, "  … and {} more\n", more + summary.tubes_forgotten);
}

void append_times(std::string& text, const RunSummary& summary) {
  if (summary.latency_ms.empty()) return;
  auto out = std::back_inserter(text);
  const auto row = [&](const char* name, const Quantiles& values) {
    fmt::format_to(out, "  {:<12} {:>8.2f} {:>8.2f}\n", name, values.at(0.5), values.at(0.99));
  };
  fmt::format_to(out, "  {:<12} {:>8} {:>8}\n", "ms a frame", "median", "p99");
  row("latency", summary.latency_ms);
  for (std::size_t i = 0; i < summary.stages_ms.size(); ++i) row(kStages[i].first, summary.stages_ms[i]);
  const LiveFigures& live = summary.live;
  if (!live.result_ms.empty()) row("to result", live.result_ms);
  if (!live.jitter_ms.empty()) row("jitter", live.jitter_ms);
}

}  // namespace

bool is_bad(TrackStatus status) {
  return status == TrackStatus::corrupt || status == TrackStatus::no_pose;
}

void add_frame(RunSummary& summary, const TubeFrame& frame) {
  ++summary.frames;
  summary.dropped = std::max(summary.dropped, frame.dropped);
  if (is_bad(frame.status)) {
    ++summary.bad[frame.status];
    return;
  }
  summary.late += frame.status == TrackStatus::deadline ? 1 : 0;
  summary.frames_with_tubes += frame.tubes.empty() ? 0 : 1;
  summary.latency_ms.add(static_cast<float>(frame.latency_ms));
  for (std::size_t i = 0; i < summary.stages_ms.size(); ++i) {
    summary.stages_ms[i].add(static_cast<float>(frame.stages.*kStages[i].second));
  }
  for (const Tube& tube : frame.tubes) {
    auto& totals = summary.tubes[tube.id];
    if (totals.frames++ == 0) totals.first_frame = frame.frame;
    totals.last_frame = frame.frame;
    totals.radius_m.add(static_cast<float>(tube.radius_m));
    totals.length_m.add(static_cast<float>(tube.length_m));
  }
  if (summary.tubes.size() > kMostTubes) forget_tubes(summary);
}

std::int64_t bad_frames(const RunSummary& summary) {
  std::int64_t count = 0;
  for (const auto& [status, frames] : summary.bad) count += frames;
  return count;
}

std::string summary_text(const RunSummary& summary) {
  std::string text =
      fmt::format("frames {}, with tubes {}, bad {}", summary.frames, summary.frames_with_tubes, bad_frames(summary));
  for (const auto& [status, frames] : summary.bad) text += fmt::format(" ({} {})", frames, status_name(status));
  if (summary.late > 0) text += fmt::format(", past the deadline {}", summary.late);
  text += fmt::format(", dropped {}", summary.dropped);
  const LiveFigures& live = summary.live;
  if (!live.result_ms.empty()) text += fmt::format(" ({} by the device)", live.device_dropped);
  if (live.losses > 0) text += fmt::format(", lost {} times for {:.1f} s in all", live.losses, live.lost_s);
  text += '\n';
  append_tubes(text, summary);
  append_times(text, summary);
  return text;
}

}  // namespace tubetrack
