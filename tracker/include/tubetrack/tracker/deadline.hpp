#pragma once

#include <chrono>
#include <optional>

namespace tubetrack {

/// When a frame must be answered.
class Deadline {
 public:
  using Clock = std::chrono::steady_clock;

  /// So long from now; never if empty.
  explicit Deadline(std::optional<double> after_ms = {}) {
    if (after_ms)
      at_ = Clock::now() +
            std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double, std::milli>(*after_ms));
  }

  /// Asked before each piece of work that can wait: true when there is no time for it.
  bool passed() {
    missed_ = missed_ || (at_ && Clock::now() >= *at_);
    return missed_;
  }
  /// Was something left out?
  bool missed() const { return missed_; }

 private:
  std::optional<Clock::time_point> at_;
  bool missed_ = false;
};

}  // namespace tubetrack
