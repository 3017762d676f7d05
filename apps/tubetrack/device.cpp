#include "device.hpp"

#include <fmt/format.h>

#include <utility>

#ifdef TUBETRACK_HAS_OPENNI2
#include "tubetrack/sensors/openni2_source.hpp"
#endif

namespace tubetrack {

namespace {

/// A live source between frames A and B of `--frames A:B`, counted from the first frame that came.
class FramesOf final : public FrameSource {
 public:
  FramesOf(std::unique_ptr<FrameSource> source, FrameRange range) : source_(std::move(source)), range_(range) {}

  const StreamInfo& info() const override { return source_->info(); }
  const std::string& last_problem() const override { return source_->last_problem(); }
  std::int64_t dropped() const override { return source_->dropped(); }

  FrameOutcome next(DepthFrame& frame, std::chrono::milliseconds patience) override {
    // Known without another frame, which the device might never send.
    if (range_.end && next_index_ >= *range_.end) return FrameOutcome::end_of_stream;
    const FrameOutcome outcome = source_->next(frame, patience);
    if (outcome != FrameOutcome::ok && outcome != FrameOutcome::corrupt) return outcome;
    next_index_ = frame.index + 1;
    if (range_.end && frame.index >= *range_.end) return FrameOutcome::end_of_stream;
    return frame.index < range_.begin ? FrameOutcome::timeout : outcome;
  }

 private:
  std::unique_ptr<FrameSource> source_;
  FrameRange range_;
  std::int64_t next_index_ = 0;
};

}  // namespace

Error without_openni2() {
  return Error::failed(
      "this tubetrack was built without OpenNI2; install libopenni2-dev (to run only: libopenni2-0) and build again");
}

Expected<std::unique_ptr<FrameSource>> open_device(const std::string& uri, const RecordingOptions& options) {
  if (options.metres_per_unit) {
    return tl::make_unexpected(Error::usage("--depth-scale: a device says its own unit; leave it out"));
  }
  if (options.pace != Pace::fast) {
    return tl::make_unexpected(Error::usage("--pace: a device has its own pace; leave it out"));
  }
#ifdef TUBETRACK_HAS_OPENNI2
  OpenNi2Options device;
  device.intrinsics_px = options.intrinsics_px;
  auto source = open_openni2(uri, device);
  if (!source) return tl::make_unexpected(source.error());
  return std::make_unique<FramesOf>(std::move(*source), options.frames);
#else
  static_cast<void>(uri);
  return tl::make_unexpected(without_openni2());
#endif
}

std::string device_note(const StreamInfo& info, const RecordingOptions& options) {
  const Intrinsics& in = info.intrinsics;
  return fmt::format("{}: {}x{}, unit {:g} m, fx {:.2f}, fy {:.2f}, cx {:.2f}, cy {:.2f} px from {}", info.name,
                     in.width, in.height, info.metres_per_unit, in.fx_px, in.fy_px, in.cx_px, in.cy_px,
                     options.intrinsics_px ? "--intrinsics" : "the device's field of view");
}

}  // namespace tubetrack
