#include "live_status.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tubetrack {

namespace {

double seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

LiveStatus::LiveStatus(double every_s) : every_s_(every_s) {
  window_.began = Clock::now();
}

void LiveStatus::add(const DepthFrame& frame, RunSummary& summary) {
  if (frame.received == Clock::time_point{}) return;  // no live device
  const auto now = Clock::now();
  if (lost_at_) {
    summary.live.lost_s += seconds(frame.received - *lost_at_);
    lost_at_.reset();
  }
  const auto result_ms = static_cast<float>(seconds(now - frame.received) * 1e3);
  summary.live.result_ms.add(result_ms);
  window_.result_ms.add(result_ms);
  if (last_) {
    const double host_s = seconds(frame.received - last_->received);
    const auto jitter_ms = static_cast<float>(std::abs(host_s - (frame.timestamp_s - last_->timestamp_s)) * 1e3);
    summary.live.jitter_ms.add(jitter_ms);
    window_.jitter_ms.add(jitter_ms);
  }
  last_.emplace();  // times alone: the pixels are not kept
  last_->received = frame.received;
  last_->timestamp_s = frame.timestamp_s;
}

void LiveStatus::lost(RunSummary& summary) {
  ++summary.live.losses;
  if (!lost_at_) lost_at_ = Clock::now();
  last_.reset();
}

std::optional<std::string> LiveStatus::line_if_due(const RunSummary& summary) {
  const auto now = Clock::now();
  const double passed_s = seconds(now - window_.began);
  if (every_s_ <= 0.0 || passed_s < every_s_) return {};
  const std::int64_t frames = summary.frames - window_.frames;
  std::string text =
      fmt::format("status: {:.1f} s, {} frames ({:.1f}/s), bad {}, dropped {}, tubes so far {}", passed_s, frames,
                  static_cast<double>(frames) / passed_s, bad_frames(summary) - window_.bad,
                  summary.dropped - window_.dropped, summary.tubes.size());
  if (!window_.result_ms.empty()) {
    text += fmt::format(", to result {:.1f} ms median {:.1f} p99, jitter {:.1f} ms p99", window_.result_ms.at(0.5),
                        window_.result_ms.at(0.99), window_.jitter_ms.at(0.99));
  }
  if (lost_at_) text += fmt::format(", device lost since {:.1f} s", seconds(now - *lost_at_));
  window_ = Window{now, summary.frames, bad_frames(summary), summary.dropped, Quantiles(), Quantiles()};
  return text;
}

}  // namespace tubetrack
