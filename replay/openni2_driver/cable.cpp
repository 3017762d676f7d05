#include "cable.hpp"

#include <chrono>
#include <utility>

namespace tubetrack {

Cable::Cable(std::function<void()> on_unplug, std::function<void()> on_replug)
    : on_unplug_(std::move(on_unplug)),
      on_replug_(std::move(on_replug)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

Cable::~Cable() = default;

void Cable::unplug(double back_after_s) {
  const std::lock_guard lock(mutex_);
  unplug_ordered_ = true;
  replug_ordered_ = false;
  back_after_s_ = back_after_s;
  wake_.notify_all();
}

void Cable::replug() {
  const std::lock_guard lock(mutex_);
  replug_ordered_ = true;
  wake_.notify_all();
}

void Cable::run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (wake_.wait(lock, stop, [this] { return unplug_ordered_ || replug_ordered_; })) {
    if (std::exchange(unplug_ordered_, false) && plugged_in_.exchange(false)) {
      const auto back = std::chrono::steady_clock::now() +
                        std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                            std::chrono::duration<double>(back_after_s_ < 0.0 ? 0.0 : back_after_s_));
      const bool comes_back = back_after_s_ >= 0.0;
      lock.unlock();
      on_unplug_();
      lock.lock();
      if (comes_back) {
        wake_.wait_until(lock, stop, back, [this] { return replug_ordered_; });
        replug_ordered_ = true;
      }
    }
    if (std::exchange(replug_ordered_, false) && !stop.stop_requested() && !plugged_in_.exchange(true)) {
      lock.unlock();
      on_replug_();
      lock.lock();
    }
  }
}

}  // namespace tubetrack
