#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace tubetrack {

/// A bar on stderr where that is a terminal, nothing elsewhere nor when `quiet`.
class Progress {
 public:
  /// `total`: frames to come, where that is known.
  Progress(bool quiet, std::optional<std::int64_t> total);
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// After so many frames, with more to say behind the bar. Ten times a second at most; oftener it does nothing.
  void show(std::int64_t frames, const std::string& more);
  void clear();

 private:
  bool shown_;
  bool drawn_ = false;
  std::optional<std::int64_t> total_;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace tubetrack
