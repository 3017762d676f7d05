#include "tubetrack/sensors/frame_queue.hpp"

#include <algorithm>
#include <utility>

namespace tubetrack {

FrameQueue::FrameQueue(std::size_t capacity) : capacity_(std::max<std::size_t>(capacity, 1)) {}

void FrameQueue::push(QueuedFrame item) {
  // "Nothing yet" is no news to whoever waits here; queued, it would grow without bound.
  if (item.outcome == FrameOutcome::timeout) return;
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    items_.push_back(std::move(item));
    const auto is_frame = [](const QueuedFrame& queued) {
      return queued.outcome == FrameOutcome::ok || queued.outcome == FrameOutcome::corrupt;
    };
    if (std::count_if(items_.begin(), items_.end(), is_frame) > static_cast<std::ptrdiff_t>(capacity_)) {
      items_.erase(std::find_if(items_.begin(), items_.end(), is_frame));
      ++dropped_;
    }
  }
  available_.notify_one();
}

bool FrameQueue::pop(QueuedFrame& item, std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  available_.wait_for(lock, patience, [this] { return closed_ || !items_.empty(); });
  if (items_.empty()) return false;
  item = std::move(items_.front());
  items_.pop_front();
  return true;
}

void FrameQueue::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  available_.notify_all();
}

std::int64_t FrameQueue::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

}  // namespace tubetrack
