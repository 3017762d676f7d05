// A .oni file as a recording: the runtime's reader (sensors), cut to the range of frames and played at its pace.
#include "oni_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#ifdef TUBETRACK_HAS_OPENNI2
#include "tubetrack/sensors/openni2_source.hpp"
#endif

namespace tubetrack {

namespace {

using Clock = std::chrono::steady_clock;

class OniClip final : public FrameSource {
 public:
  OniClip(std::unique_ptr<FrameSource> file, std::int64_t begin, std::int64_t end, Pace pace)
      : file_(std::move(file)), info_(file_->info()), begin_(begin), end_(end), pace_(pace) {
    info_.frame_count = end - begin;
  }

  const StreamInfo& info() const override { return info_; }
  const std::string& last_problem() const override { return file_->last_problem(); }
  FrameOutcome next(DepthFrame& frame, std::chrono::milliseconds patience) override;

 private:
  bool due(const DepthFrame& frame, std::chrono::milliseconds patience);

  std::unique_ptr<FrameSource> file_;
  StreamInfo info_;
  std::int64_t begin_;
  std::int64_t end_;
  Pace pace_;
  std::optional<DepthFrame> waiting_;  ///< read, and not due yet
  std::int64_t next_ = 0;
  std::optional<Clock::time_point> started_;
  double first_s_ = 0.0;
};

/// False when the frame is not due within `patience` (which then has passed).
bool OniClip::due(const DepthFrame& frame, std::chrono::milliseconds patience) {
  if (pace_ == Pace::fast) return true;
  if (!started_) {
    started_ = Clock::now();
    first_s_ = frame.timestamp_s;
  }
  const std::chrono::duration<double> since_first(std::min(frame.timestamp_s - first_s_, 86400.0));
  const auto at = *started_ + std::chrono::duration_cast<Clock::duration>(since_first);
  const auto give_up = Clock::now() + patience;
  std::this_thread::sleep_until(std::min(at, give_up));
  return at <= give_up;
}

FrameOutcome OniClip::next(DepthFrame& frame, std::chrono::milliseconds patience) {
  if (!waiting_) {
    if (next_ >= end_) return FrameOutcome::end_of_stream;
    const FrameOutcome outcome = file_->next(frame, patience);
    if (outcome != FrameOutcome::ok && outcome != FrameOutcome::corrupt) return outcome;
    next_ = frame.index + 1;
    if (frame.index < begin_) return FrameOutcome::timeout;
    if (outcome == FrameOutcome::corrupt) return outcome;
    waiting_ = frame;
  }
  if (!due(*waiting_, patience)) return FrameOutcome::timeout;
  frame = *waiting_;
  waiting_.reset();
  return FrameOutcome::ok;
}

}  // namespace

#ifdef TUBETRACK_HAS_OPENNI2
Expected<std::unique_ptr<FrameSource>> open_oni_recording(const std::filesystem::path& path,
                                                          const RecordingOptions& options) {
  if (options.metres_per_unit) {
    return tl::make_unexpected(Error::usage("--depth-scale: an .oni says its own unit; leave it out"));
  }
  OpenNi2Options reading;
  reading.intrinsics_px = options.intrinsics_px;
  auto file = open_oni_file(path, reading);
  if (!file) return file;
  const std::int64_t count = (*file)->info().frame_count.value_or(0);
  if (count == 0) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: has not one frame; record again", path.string())));
  }
  const std::int64_t end = std::min(options.frames.end.value_or(count), count);
  if (options.frames.begin >= end) {
    return tl::make_unexpected(
        Error::usage(fmt::format("--frames {}:: no frame of {} is in it, which has frames 0 to {}",
                                 options.frames.begin, path.string(), count - 1)));
  }
  return std::make_unique<OniClip>(std::move(*file), options.frames.begin, end, options.pace);
}
#else
Expected<std::unique_ptr<FrameSource>> open_oni_recording(const std::filesystem::path& path, const RecordingOptions&) {
  return tl::make_unexpected(Error::failed(
      fmt::format("{}: this tubetrack was built without OpenNI2, which reads .oni; install libopenni2-dev and build "
                  "again",
                  path.string())));
}
#endif

}  // namespace tubetrack
