// Reading .oni files, which the runtime decodes without checking them, by a process that may crash.
#include "oni_process.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "pixel_pool.hpp"
#include "tubetrack/sensors/child_process.hpp"

namespace tubetrack {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr const char* kProgram = "tubetrack_oni_reader";
/// The reader says within 2 s that a file does not go on, so after this time it is the runtime that hangs.
constexpr milliseconds kPatience{20000};
constexpr std::uint32_t kLongestText = 1 << 16;  ///< more is rubbish of a process that is about to crash

class OniProcessSource final : public FrameSource {
 public:
  OniProcessSource(ChildProcess reader, StreamInfo info)
      : reader_(std::move(reader)),
        info_(std::move(info)),
        pool_(std::make_shared<PixelPool>(static_cast<std::size_t>(info_.intrinsics.width) *
                                          static_cast<std::size_t>(info_.intrinsics.height))) {}

  const StreamInfo& info() const override { return info_; }
  const std::string& last_problem() const override { return problem_; }
  FrameOutcome next(DepthFrame& frame, milliseconds patience) override;

 private:
  FrameOutcome lost(const char* what) {
    problem_ = fmt::format("the OpenNI2 runtime {} reading it after {} frame(s); the file is damaged", what, next_);
    return FrameOutcome::device_lost;
  }

  ChildProcess reader_;
  StreamInfo info_;
  std::shared_ptr<PixelPool> pool_;
  std::string problem_;
  std::int64_t next_ = 0;
  bool ended_ = false;
  steady_clock::time_point last_sign_ = steady_clock::now();
};

FrameOutcome OniProcessSource::next(DepthFrame& frame, milliseconds patience) {
  if (ended_) return FrameOutcome::end_of_stream;
  if (!reader_.ready(patience)) {
    return steady_clock::now() - last_sign_ < kPatience ? FrameOutcome::timeout : lost("hung");
  }
  last_sign_ = steady_clock::now();
  OniFrame head;
  if (!reader_.receive(&head, sizeof head) || head.problem_bytes > kLongestText) return lost("crashed");
  problem_.resize(head.problem_bytes);
  if (!reader_.receive(problem_.data(), problem_.size())) return lost("crashed");
  ended_ = head.outcome == FrameOutcome::end_of_stream;
  frame = DepthFrame{};
  frame.index = head.index;
  frame.timestamp_s = head.timestamp_s;
  if (head.outcome != FrameOutcome::ok) return head.outcome;
  const auto pixels = pool_->take();
  frame.metres_per_unit = info_.metres_per_unit;
  frame.width = info_.intrinsics.width;
  frame.height = info_.intrinsics.height;
  frame.stride_bytes = static_cast<std::size_t>(frame.width) * sizeof(std::uint16_t);
  if (!reader_.receive(pixels.get(), frame.stride_bytes * static_cast<std::size_t>(frame.height))) {
    return lost("crashed");
  }
  frame.pixels = pixels.get();
  frame.keep_alive = pixels;
  next_ = frame.index + 1;
  return FrameOutcome::ok;
}

Expected<std::unique_ptr<FrameSource>> open_by_reader(const std::string& path, const OpenNi2Options& options) {
  const auto failed = [](std::string text) { return tl::make_unexpected(Error::failed(std::move(text))); };
  auto reader = ChildProcess::start(kProgram, {});
  if (!reader) return tl::make_unexpected(reader.error());
  OniRequest request;
  request.has_intrinsics = options.intrinsics_px.has_value();
  if (options.intrinsics_px) request.intrinsics_px = *options.intrinsics_px;
  request.path_bytes = static_cast<std::uint32_t>(path.size());
  OniOpened opened;
  const bool asked = reader->send(&request, sizeof request) && reader->send(path.data(), path.size());
  if (asked && !reader->ready(kPatience)) {
    return failed(fmt::format("{}: can't be read as .oni: the OpenNI2 runtime hangs opening it; record again", path));
  }
  if (!asked || !reader->receive(&opened, sizeof opened) || opened.error_bytes > kLongestText ||
      (opened.error_bytes == 0 && !validate(opened.intrinsics))) {
    return failed(fmt::format("{}: can't be read as .oni: the OpenNI2 runtime crashed opening it; record again", path));
  }
  if (opened.error_bytes > 0) {
    std::string error(opened.error_bytes, '\0');
    reader->receive(error.data(), error.size());
    return failed(std::move(error));
  }
  StreamInfo info{path, opened.intrinsics, opened.metres_per_unit, false, opened.frame_count, "recording"};
  return std::make_unique<OniProcessSource>(std::move(*reader), std::move(info));
}

}  // namespace

Expected<std::unique_ptr<FrameSource>> open_oni_file(const std::filesystem::path& path, const OpenNi2Options& options) {
  // A relative path with a slash in it may look like a device to another driver.
  std::error_code ignored;
  const auto whole = std::filesystem::absolute(path, ignored);
  const auto name = ignored ? path : whole;
  if (ChildProcess::beside_us(kProgram).empty()) return open_oni_file_here(name, options);
  return open_by_reader(name.string(), options);
}

}  // namespace tubetrack
