#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "run.hpp"
#include "tubetrack/sensors/frame_queue.hpp"

namespace tubetrack {

/// The frame with pixels of its own where it had none (no keep_alive): it outlives the source's next call.
DepthFrame kept(const DepthFrame& frame);

/// Frames one after the other, straight from the source or (realtime) through a queue that a second thread fills.
class Feed {
 public:
  Feed(FrameSource& source, const RunOptions& options);
  ~Feed();
  Feed(const Feed&) = delete;
  Feed& operator=(const Feed&) = delete;

  /// The next frame; outcome `timeout` where none came within 100 ms. The error is that of options.on_frame.
  Expected<QueuedFrame> next();
  /// By the queue and by the source itself, so far.
  std::int64_t dropped() const;
  std::int64_t dropped_by_source() const { return source_dropped_; }
  /// What the source wants people to know, one line each; empty when asked again. Not bound to a frame, which may be
  /// dropped.
  std::vector<std::string> take_notes();

 private:
  Expected<QueuedFrame> fetch();
  void capture();

  FrameSource& source_;
  const RunOptions& options_;
  FrameQueue queue_;
  std::thread thread_;
  std::atomic<bool> stop_{false};
  std::atomic<std::int64_t> source_dropped_{0};  ///< the source is asked on its own thread only
  std::mutex notes_mutex_;
  std::vector<std::string> notes_;
  std::optional<Error> on_frame_error_;
  std::atomic<bool> failed_{false};  ///< on_frame_error_ is there: after a loss that is survived, capture goes on
};

}  // namespace tubetrack
