#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "image_file.hpp"
#include "recorded_sequence.hpp"

namespace tubetrack {

namespace {

using Clock = std::chrono::steady_clock;

/// Any recording, once its frames are listed: decodes one image a call.
class RecordedSource : public FrameSource {
 public:
  RecordedSource(std::vector<RecordedFrame> frames, StreamInfo info, std::int64_t first, std::int64_t last, Pace pace)
      : frames_(std::move(frames)), info_(std::move(info)), next_(first), last_(last), pace_(pace) {}

  const StreamInfo& info() const override { return info_; }
  const std::string& last_problem() const override { return problem_; }
  FrameOutcome next(DepthFrame& frame, std::chrono::milliseconds patience) override;

 private:
  const RecordedFrame& at(std::int64_t index) const { return frames_[static_cast<std::size_t>(index)]; }
  /// Compared with the line before, not with the latest stamp so far: a clock set back costs one frame, not the rest.
  bool time_goes_back() const { return next_ > 0 && at(next_).timestamp_s < at(next_ - 1).timestamp_s; }
  bool wait_until_due(std::chrono::milliseconds patience);
  FrameOutcome corrupt(std::string why) {
    problem_ = std::move(why);
    return FrameOutcome::corrupt;
  }

  std::vector<RecordedFrame> frames_;
  StreamInfo info_;
  std::int64_t next_;
  std::int64_t last_;
  Pace pace_;
  std::optional<Clock::time_point> anchor_;  ///< realtime: the moment at which anchor_timestamp_s_ plays
  double anchor_timestamp_s_ = 0.0;
  std::string problem_;
};

/// False when the frame is not due within `patience` (which then has passed).
bool RecordedSource::wait_until_due(std::chrono::milliseconds patience) {
  const double timestamp_s = at(next_).timestamp_s;
  if (!anchor_ || time_goes_back()) {
    anchor_ = Clock::now();
    anchor_timestamp_s_ = timestamp_s;
  }
  // A gap of more than a day is a wrong stamp; the bound keeps the sum inside what the clock can hold.
  const double ahead_s = std::min(timestamp_s - anchor_timestamp_s_, 86400.0);
  const auto due = *anchor_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(ahead_s));
  const auto give_up = Clock::now() + patience;
  std::this_thread::sleep_until(std::min(due, give_up));
  return due <= give_up;
}

FrameOutcome RecordedSource::next(DepthFrame& frame, std::chrono::milliseconds patience) {
  if (next_ >= last_) return FrameOutcome::end_of_stream;
  if (pace_ == Pace::realtime && !wait_until_due(patience)) return FrameOutcome::timeout;
  const RecordedFrame& recorded = at(next_);
  frame = DepthFrame{};
  frame.index = next_;
  frame.timestamp_s = recorded.timestamp_s;
  frame.metres_per_unit = info_.metres_per_unit;
  frame.world_from_camera = recorded.world_from_camera;
  frame.pose_missing = info_.has_poses && !recorded.world_from_camera;
  const bool back = time_goes_back();
  ++next_;
  if (back) {
    return corrupt(fmt::format("{}: timestamp {} goes back (the line before has {}); correct the order",
                               recorded.listed_in, recorded.timestamp_s, at(next_ - 2).timestamp_s));
  }
  const auto image = read_depth_image(recorded.image);
  if (!image) return corrupt(image.error().message);
  if (image->width != info_.intrinsics.width || image->height != info_.intrinsics.height) {
    return corrupt(fmt::format("{}: size {} x {}, takes {} x {} like the frames before; take it out of the recording",
                               recorded.image.string(), image->width, image->height, info_.intrinsics.width,
                               info_.intrinsics.height));
  }
  frame.pixels = image->pixels;
  frame.width = image->width;
  frame.height = image->height;
  frame.stride_bytes = image->stride_bytes;
  frame.keep_alive = image->owner;
  problem_.clear();
  return FrameOutcome::ok;
}

}  // namespace

std::unique_ptr<FrameSource> play_sequence(std::vector<RecordedFrame> frames, StreamInfo info, std::int64_t first,
                                           std::int64_t last, Pace pace) {
  return std::make_unique<RecordedSource>(std::move(frames), std::move(info), first, last, pace);
}

}  // namespace tubetrack
