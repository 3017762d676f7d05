#include "feed.hpp"

#include <chrono>
#include <memory>
#include <utility>
#include <vector>

namespace tubetrack {

namespace {

constexpr std::chrono::milliseconds kPatience{100};  ///< how long Ctrl-C may have to wait for a silent source

}  // namespace

DepthFrame kept(const DepthFrame& frame) {
  if (frame.keep_alive || frame.pixels == nullptr) return frame;
  auto pixels = std::make_shared<std::vector<std::uint16_t>>();
  pixels->reserve(static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height));
  for (int v = 0; v < frame.height; ++v) pixels->insert(pixels->end(), frame.row(v), frame.row(v) + frame.width);
  DepthFrame copy = frame;
  copy.pixels = pixels->data();
  copy.stride_bytes = static_cast<std::size_t>(frame.width) * sizeof(std::uint16_t);
  copy.keep_alive = std::move(pixels);
  return copy;
}

Feed::Feed(FrameSource& source, const RunOptions& options)
    : source_(source), options_(options), queue_(options.queue_frames) {
  if (options_.realtime) thread_ = std::thread([this] { capture(); });
}

Feed::~Feed() {
  stop_ = true;
  queue_.close();
  if (thread_.joinable()) thread_.join();
}

Expected<QueuedFrame> Feed::next() {
  if (!options_.realtime) return fetch();
  QueuedFrame item;
  if (!queue_.pop(item, kPatience)) item.outcome = FrameOutcome::timeout;
  // Set by the capturing thread after the error itself and before it pushed device_lost.
  if (item.outcome == FrameOutcome::device_lost && failed_ && on_frame_error_)
    return tl::make_unexpected(*on_frame_error_);
  return item;
}

std::int64_t Feed::dropped() const {
  return source_dropped_ + queue_.dropped();
}

std::vector<std::string> Feed::take_notes() {
  const std::lock_guard lock(notes_mutex_);
  return std::exchange(notes_, {});
}

Expected<QueuedFrame> Feed::fetch() {
  QueuedFrame item;
  item.outcome = source_.next(item.frame, kPatience);
  if (auto note = source_.take_note(); !note.empty()) {
    const std::lock_guard lock(notes_mutex_);
    notes_.push_back(std::move(note));
  }
  source_dropped_ = source_.dropped();
  if (item.outcome == FrameOutcome::corrupt || item.outcome == FrameOutcome::device_lost) {
    item.problem = source_.last_problem();
  }
  if (item.outcome == FrameOutcome::ok && options_.on_frame) {
    if (auto seen = options_.on_frame(item.frame); !seen) return tl::make_unexpected(seen.error());
  }
  return item;
}

void Feed::capture() {
  while (!stop_) {
    auto item = fetch();
    if (!item) {
      on_frame_error_ = std::move(item.error());
      failed_ = true;
      queue_.push({FrameOutcome::device_lost, {}, {}});
      return;
    }
    if (item->outcome == FrameOutcome::timeout) continue;
    const bool last = item->outcome == FrameOutcome::end_of_stream ||
                      (item->outcome == FrameOutcome::device_lost && !options_.survive_loss);
    if (item->outcome == FrameOutcome::ok) item->frame = kept(item->frame);
    queue_.push(std::move(*item));
    if (last) return;
  }
}

}  // namespace tubetrack
