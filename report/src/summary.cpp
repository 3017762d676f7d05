#include "tubetrack/report/summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "tubetrack/report/result_json.hpp"

namespace tubetrack {

namespace {

constexpr std::size_t kMaxTubesShown = 20;

/// The smallest value with at least `part` of all at or below it; 0 for no values.
double quantile(std::vector<float> values, double part) {
  if (values.empty()) return 0.0;
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(values.size())));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(rank, 1, values.size()) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

void append_tubes(std::string& text, const RunSummary& summary) {
  std::vector<const std::pair<const std::int64_t, RunSummary::TubeTotals>*> tubes;
  tubes.reserve(summary.tubes.size());
  for (const auto& tube : summary.tubes) tubes.push_back(&tube);
  std::stable_sort(tubes.begin(), tubes.end(),
                   [](const auto* a, const auto* b) { return a->second.frames > b->second.frames; });
  auto out = std::back_inserter(text);
  fmt::format_to(out, "tubes {}{}\n", tubes.size(), tubes.empty() ? "" : ", the longest seen first (medians):");
  if (tubes.empty()) return;
  fmt::format_to(out, "  {:>5} {:>10} {:>10} {:>8}  {}\n", "id", "radius mm", "length mm", "frames", "first-last");
  for (std::size_t i = 0; i < std::min(tubes.size(), kMaxTubesShown); ++i) {
    const auto& [id, totals] = *tubes[i];
    fmt::format_to(out, "  {:>5} {:>10.1f} {:>10.0f} {:>8}  {}-{}\n", id, quantile(totals.radius_m, 0.5) * 1e3,
                   quantile(totals.length_m, 0.5) * 1e3, totals.frames, totals.first_frame, totals.last_frame);
  }
  if (tubes.size() > kMaxTubesShown) fmt::format_to(out, "  … and {} more\n", tubes.size() - kMaxTubesShown);
}

void append_times(std::string& text, const RunSummary& summary) {
  if (summary.latency_ms.empty()) return;
  constexpr std::pair<const char*, double StageTimes::*> kStages[] = {{"update", &StageTimes::update_ms},
                                                                      {"normals", &StageTimes::normals_ms},
                                                                      {"accumulate", &StageTimes::accumulate_ms},
                                                                      {"trace", &StageTimes::trace_ms},
                                                                      {"fit", &StageTimes::fit_ms},
                                                                      {"segment", &StageTimes::segment_ms}};
  auto out = std::back_inserter(text);
  const auto row = [&](const char* name, const std::vector<float>& values) {
    fmt::format_to(out, "  {:<12} {:>8.2f} {:>8.2f}\n", name, quantile(values, 0.5), quantile(values, 0.99));
  };
  fmt::format_to(out, "  {:<12} {:>8} {:>8}\n", "ms a frame", "median", "p99");
  row("latency", summary.latency_ms);
  for (const auto& [name, member] : kStages) {
    std::vector<float> values;
    values.reserve(summary.stages.size());
    for (const StageTimes& times : summary.stages) values.push_back(static_cast<float>(times.*member));
    row(name, values);
  }
}

}  // namespace

bool is_bad(TrackStatus status) {
  return status == TrackStatus::corrupt || status == TrackStatus::no_pose || status == TrackStatus::deadline;
}

void add_frame(RunSummary& summary, const TubeFrame& frame) {
  ++summary.frames;
  summary.dropped = std::max(summary.dropped, frame.dropped);
  if (is_bad(frame.status)) {
    ++summary.bad[frame.status];
    return;
  }
  summary.frames_with_tubes += frame.tubes.empty() ? 0 : 1;
  summary.latency_ms.push_back(static_cast<float>(frame.latency_ms));
  summary.stages.push_back(frame.stages);
  for (const Tube& tube : frame.tubes) {
    auto& totals = summary.tubes[tube.id];
    if (totals.frames++ == 0) totals.first_frame = frame.frame;
    totals.last_frame = frame.frame;
    totals.radius_m.push_back(static_cast<float>(tube.radius_m));
    totals.length_m.push_back(static_cast<float>(tube.length_m));
  }
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
  text += fmt::format(", dropped {}\n", summary.dropped);
  append_tubes(text, summary);
  append_times(text, summary);
  return text;
}

}  // namespace tubetrack
