#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "tubetrack/report/summary.hpp"
#include "tubetrack/sensors/depth_frame.hpp"

namespace tubetrack {

/// What a live run says about itself: fills the summary's live figures, and gives a line about the time since the line
/// before, every so often.
class LiveStatus {
 public:
  explicit LiveStatus(double every_s);

  /// A frame whose result has been written.
  void add(const DepthFrame& frame, RunSummary& summary);
  void lost(RunSummary& summary);

  /// The line, where one is due. Counts that are not its own come from the summary.
  std::optional<std::string> line_if_due(const RunSummary& summary);

 private:
  using Clock = std::chrono::steady_clock;

  /// What is said in a line; begun anew with each.
  struct Window {
    Clock::time_point began;
    std::int64_t frames = 0;
    std::int64_t bad = 0;
    std::int64_t dropped = 0;
    Quantiles result_ms;
    Quantiles jitter_ms;
  };

  double every_s_;
  Window window_;  ///< its counts: the summary's when it began
  std::optional<DepthFrame> last_;
  std::optional<Clock::time_point> lost_at_;
};

}  // namespace tubetrack
