#pragma once

#include <chrono>

namespace tubetrack {

/// Adds the time since its construction, or since the last call, to the stage it is told.
class Stopwatch {
 public:
  void lap(double& stage_ms) {
    const auto now = std::chrono::steady_clock::now();
    stage_ms += std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace tubetrack
