// Reading .oni files by the runtime's own player.
#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "oni_process.hpp"
#include "oni_structure.hpp"
#include "openni2_runtime.hpp"
#include "pixel_pool.hpp"

namespace tubetrack {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// How long the player may take for a frame; after that the file is damaged.
constexpr milliseconds kSilence{2000};

class OniFileSource final : public FrameSource {
 public:
  OniFileSource(std::shared_ptr<OpenNi2Runtime> runtime, const std::filesystem::path& path)
      : runtime_(std::move(runtime)) {
    info_.name = path.string();
  }
  ~OniFileSource() override;

  Expected<void> start(const OpenNi2Options& options);

  const StreamInfo& info() const override { return info_; }
  FrameOutcome next(DepthFrame& frame, milliseconds patience) override;
  const std::string& last_problem() const override { return problem_; }

 private:
  FrameOutcome damaged(DepthFrame& frame);
  FrameOutcome hand_over(const openni::VideoFrameRef& file_frame, DepthFrame& frame);

  std::shared_ptr<OpenNi2Runtime> runtime_;
  openni::Device device_;
  openni::VideoStream stream_;
  StreamInfo info_;
  bool mirrored_ = false;
  std::shared_ptr<PixelPool> pool_;
  std::string problem_;
  std::int64_t next_ = 0;
  double last_s_ = 0.0;
  steady_clock::time_point last_sign_;
};

OniFileSource::~OniFileSource() {
  stream_.stop();
  // The runtime's player thread may still be inside the stream; destroyed at once, it crashed in 10 of 12 runs.
  std::this_thread::sleep_for(milliseconds{50});
  stream_.destroy();
  device_.close();
}

Expected<void> OniFileSource::start(const OpenNi2Options& options) {
  const std::string& name = info_.name;
  if (const auto problem = oni_structure_problem(name); !problem.empty()) {
    return openni2_failed(fmt::format(
        "{}: can't be read as .oni: {}; record again (a recorder that is killed leaves a folder readable up "
        "to its last frame, an .oni not)",
        name, problem));
  }
  if (device_.open(name.c_str()) != openni::STATUS_OK) {
    return openni2_failed(fmt::format("{}: can't be read as .oni: {}; record again", name, openni2_says()));
  }
  openni::PlaybackControl* playback = device_.getPlaybackControl();
  if (!device_.isFile() || playback == nullptr || !device_.hasSensor(openni::SENSOR_DEPTH)) {
    return openni2_failed(fmt::format("{}: has no depth stream; take a recording with one", name));
  }
  if (stream_.create(device_, openni::SENSOR_DEPTH) != openni::STATUS_OK) {
    return openni2_failed(fmt::format("{}: its depth stream can't be read: {}", name, openni2_says()));
  }
  info_.metres_per_unit = metres_per_unit_of(stream_.getVideoMode().getPixelFormat());
  if (info_.metres_per_unit == 0.0) {
    return openni2_failed(fmt::format("{}: its depths are not in 1 mm or 100 um (raw shifts?); record it again", name));
  }
  OpenNi2Options whole = options;
  whole.crop_px.reset();
  openni::VideoStream& stream = stream_;
  int u = 0;
  int v = 0;
  int width = 0;
  int height = 0;
  if (stream.isCroppingSupported() && stream.getCropping(&u, &v, &width, &height)) {
    whole.crop_px = {u, v, width, height};
  }
  mirrored_ = stream_.getMirroringEnabled();
  if (mirrored_ && whole.crop_px) (*whole.crop_px)[0] = stream_.getVideoMode().getResolutionX() - u - width;
  const auto intrinsics = openni2_intrinsics(stream_, whole, name);
  if (!intrinsics) return tl::make_unexpected(intrinsics.error());
  info_.intrinsics = *intrinsics;
  info_.frame_count = playback->getNumberOfFrames(stream_);
  info_.device = "recording";
  pool_ = std::make_shared<PixelPool>(static_cast<std::size_t>(intrinsics->width) *
                                      static_cast<std::size_t>(intrinsics->height));
  // Only this pair gives every frame once: at other speeds the player drops some.
  playback->setRepeatEnabled(false);
  if (playback->setSpeed(-1.0F) != openni::STATUS_OK || stream_.start() != openni::STATUS_OK) {
    return openni2_failed(fmt::format("{}: does not play: {}", name, openni2_says()));
  }
  last_sign_ = steady_clock::now();
  return {};
}

FrameOutcome OniFileSource::next(DepthFrame& frame, milliseconds patience) {
  // The runtime's own end of file comes before the last frame, so the end is told by the count.
  if (next_ >= info_.frame_count.value_or(0)) return FrameOutcome::end_of_stream;
  const int wait_ms = static_cast<int>(std::clamp(patience, milliseconds{0}, kSilence).count());
  openni::VideoStream* stream = &stream_;
  int ready = -1;
  const openni::Status waited = openni::OpenNI::waitForAnyStream(&stream, 1, &ready, wait_ms);
  openni::VideoFrameRef file_frame;
  if (waited == openni::STATUS_OK && stream_.readFrame(&file_frame) == openni::STATUS_OK && file_frame.isValid()) {
    return hand_over(file_frame, frame);
  }
  if (waited == openni::STATUS_TIME_OUT && steady_clock::now() - last_sign_ < kSilence) return FrameOutcome::timeout;
  return damaged(frame);
}

FrameOutcome OniFileSource::damaged(DepthFrame& frame) {
  problem_ = fmt::format("{}: nothing can be read after frame {} of {}: the file is damaged there", info_.name, next_,
                         info_.frame_count.value_or(0));
  frame = DepthFrame{};
  frame.index = next_;
  frame.timestamp_s = last_s_;
  next_ = info_.frame_count.value_or(0);
  return FrameOutcome::corrupt;
}

FrameOutcome OniFileSource::hand_over(const openni::VideoFrameRef& file_frame, DepthFrame& frame) {
  last_sign_ = steady_clock::now();
  const bool first = next_ == 0;
  frame = DepthFrame{};
  frame.index = next_++;
  frame.timestamp_s = static_cast<double>(file_frame.getTimestamp()) / 1e6;
  frame.metres_per_unit = info_.metres_per_unit;
  frame.width = info_.intrinsics.width;
  frame.height = info_.intrinsics.height;
  auto problem = openni2_frame_problem(file_frame, info_.intrinsics);
  if (problem.empty() && !first && frame.timestamp_s <= last_s_) {
    problem = fmt::format("timestamp_s went back from {:.6f} to {:.6f}", last_s_, frame.timestamp_s);
  }
  if (!problem.empty()) {
    problem_ = fmt::format("{}: frame {}: {}", info_.name, frame.index, problem);
    return FrameOutcome::corrupt;
  }
  last_s_ = frame.timestamp_s;
  const auto pixels = pool_->take();
  copy_openni2_pixels(file_frame, info_.intrinsics, mirrored_, pixels.get());
  frame.pixels = pixels.get();
  frame.stride_bytes = static_cast<std::size_t>(frame.width) * sizeof(std::uint16_t);
  frame.keep_alive = pixels;
  return FrameOutcome::ok;
}

}  // namespace

Expected<std::unique_ptr<FrameSource>> open_oni_file_here(const std::filesystem::path& path,
                                                          const OpenNi2Options& options) {
  auto runtime = use_openni2();
  if (!runtime) return tl::make_unexpected(runtime.error());
  auto source = std::make_unique<OniFileSource>(std::move(*runtime), path);
  if (auto started = source->start(options); !started) return tl::make_unexpected(started.error());
  return source;
}

}  // namespace tubetrack
