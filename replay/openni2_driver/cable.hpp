#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace tubetrack {

/// The virtual device's plug. What it calls runs on a thread of its own: the runtime takes its locks in there, and a
/// caller may hold them already.
class Cable {
 public:
  Cable(std::function<void()> on_unplug, std::function<void()> on_replug);
  /// Waits for a call that is running.
  ~Cable();

  bool plugged_in() const { return plugged_in_; }
  /// Out now, and in again after `back_after_s`; below 0: only by `replug`.
  void unplug(double back_after_s);
  void replug();

 private:
  void run(const std::stop_token& stop);

  std::function<void()> on_unplug_;
  std::function<void()> on_replug_;
  std::atomic<bool> plugged_in_ = true;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  bool unplug_ordered_ = false;
  bool replug_ordered_ = false;
  double back_after_s_ = -1.0;
  std::jthread thread_;  ///< last: it uses everything above
};

}  // namespace tubetrack
