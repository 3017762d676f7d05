#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "tubetrack/sensors/child_process.hpp"
#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/intrinsics.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// The window of `--view`: shows the newest result, at most some thirty times a second, from a thread of its own, so
/// that drawing never holds up tracking. The window itself is a process (tubetrack_window): a graphics system that
/// takes its program down with it does not take this one. When it is closed, the run is ended as by Ctrl-C.
class View {
 public:
  /// The error says which package is missing, or that there is no display.
  static Expected<std::unique_ptr<View>> open(const std::string& title, const Intrinsics& intrinsics);
  ~View();
  View(const View&) = delete;
  View& operator=(const View&) = delete;

  /// In place of what was handed over before and is not drawn yet.
  void show(const DepthFrame& frame, const TubeFrame& result);

 private:
  struct Shown {
    DepthFrame frame;
    TubeFrame result;
  };

  View(ChildProcess window, const Intrinsics& intrinsics);
  void draw_newest();
  std::optional<Shown> wait_for_newest();

  ChildProcess window_;
  Intrinsics intrinsics_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Shown> newest_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace tubetrack
