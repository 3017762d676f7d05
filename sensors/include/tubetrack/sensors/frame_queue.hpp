#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>

#include "tubetrack/sensors/frame_source.hpp"

namespace tubetrack {

/// What a source said for one frame, to hand over between threads. A frame in it must have its keep_alive set.
struct QueuedFrame {
  FrameOutcome outcome = FrameOutcome::ok;
  DepthFrame frame;
  std::string problem;
};

/// Bounded queue between the thread that captures and the one that tracks. When full, the oldest *frame* goes and is
/// counted: a live tracker wants the newest. End of stream and device loss are never dropped; time-outs aren't queued.
class FrameQueue {
 public:
  explicit FrameQueue(std::size_t capacity);

  void push(QueuedFrame item);
  /// False when nothing came within `patience`, or the queue is closed and empty.
  bool pop(QueuedFrame& item, std::chrono::milliseconds patience);
  /// Wakes everybody; later pushes are ignored.
  void close();
  std::int64_t dropped() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable available_;
  std::deque<QueuedFrame> items_;
  std::size_t capacity_;
  std::int64_t dropped_ = 0;
  bool closed_ = false;
};

}  // namespace tubetrack
