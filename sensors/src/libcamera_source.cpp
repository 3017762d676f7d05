#include "tubetrack/sensors/libcamera_source.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <utility>

#include "libcamera_setup.hpp"
#include "mono_pixels.hpp"
#include "pixel_pool.hpp"
#include "stream_clock.hpp"

namespace tubetrack {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

class LibcameraSource final : public FrameSource {
 public:
  explicit LibcameraSource(std::unique_ptr<LibcameraManager> manager) : manager_(std::move(manager)) {}
  ~LibcameraSource() override;

  Expected<void> start(const std::string& id, const LibcameraOptions& options);

  const StreamInfo& info() const override { return info_; }
  FrameOutcome next(DepthFrame& frame, milliseconds patience) override;
  const std::string& last_problem() const override { return problem_; }
  std::string take_note() override { return std::exchange(note_, {}); }
  std::int64_t dropped() const override { return dropped_; }

 private:
  Expected<void> take_camera(const std::string& id);
  void wait_for_sign_of_life();
  Expected<void> allocate();
  Expected<void> stream();
  FrameOutcome hand_over(libcamera::Request& request, DepthFrame& frame);
  FrameOutcome refuse(FrameOutcome outcome, std::string problem) {
    problem_ = std::move(problem);
    return outcome;
  }

  // What libcamera holds, in the order it must be taken down in, last first.
  std::unique_ptr<LibcameraManager> manager_;
  std::shared_ptr<libcamera::Camera> camera_;
  bool acquired_ = false;
  bool started_ = false;
  std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
  std::map<const libcamera::FrameBuffer*, LibcameraMapping> mappings_;
  std::vector<std::unique_ptr<libcamera::Request>> requests_;

  std::mutex mutex_;  ///< for what libcamera's thread writes
  std::condition_variable changed_;
  std::deque<libcamera::Request*> completed_;
  bool disconnected_ = false;

  StreamInfo info_;
  MonoPacking packing_ = MonoPacking::words;
  std::shared_ptr<PixelPool> pool_;
  std::string problem_;
  std::string note_;
  std::int64_t dropped_ = 0;
  std::optional<std::int64_t> first_sequence_;
  std::int64_t last_sequence_ = 0;
  StreamClock clock_;
};

LibcameraSource::~LibcameraSource() {
  if (!camera_) return;
  if (started_) {
    wait_for_sign_of_life();
    camera_->stop();
  }
  camera_->requestCompleted.disconnect(this);
  camera_->disconnected.disconnect(this);
  requests_.clear();
  mappings_.clear();
  if (allocator_ && configuration_) allocator_->free(configuration_->at(0).stream());
  allocator_.reset();
  configuration_.reset();
  if (acquired_) camera_->release();
  camera_.reset();
}

/// Stopping a camera that was unplugged, and has not said so yet, ends the program inside libcamera: so first a frame
/// that is newer than now, or its word; neither comes of a camera that stalls.
void LibcameraSource::wait_for_sign_of_life() {
  std::unique_lock lock(mutex_);
  completed_.clear();
  changed_.wait_for(lock, std::chrono::seconds{1}, [this] { return disconnected_ || !completed_.empty(); });
}

Expected<void> LibcameraSource::start(const std::string& id, const LibcameraOptions& options) {
  if (options.metres_per_unit <= 0.0) {
    return tl::make_unexpected(Error::usage(
        "libcamera: a camera does not say what its grey values mean; give --depth-scale, the metres of one unit"));
  }
  if (auto taken = take_camera(id); !taken) return taken;
  auto configuration = configure_libcamera(*camera_, options, info_, packing_);
  if (!configuration) return tl::make_unexpected(configuration.error());
  configuration_ = std::move(*configuration);
  const auto intrinsics = libcamera_intrinsics(options, info_);
  if (!intrinsics) return tl::make_unexpected(intrinsics.error());
  info_.intrinsics = *intrinsics;
  if (auto allocated = allocate(); !allocated) return allocated;
  return stream();
}

Expected<void> LibcameraSource::take_camera(const std::string& id) {
  auto chosen = choose_libcamera(**manager_, id);
  if (!chosen) return tl::make_unexpected(chosen.error());
  camera_ = *chosen;
  info_.name = "libcamera:" + camera_->id();
  info_.device = libcamera_model(*camera_);
  if (camera_->acquire() != 0) {
    return failed(fmt::format("{}: can't be taken; is another program using it?", info_.name));
  }
  acquired_ = true;
  camera_->disconnected.connect(this, [this] {
    const std::lock_guard lock(mutex_);
    disconnected_ = true;
    changed_.notify_all();
  });
  return {};
}

Expected<void> LibcameraSource::allocate() {
  libcamera::Stream* const stream = configuration_->at(0).stream();
  allocator_ = std::make_unique<libcamera::FrameBufferAllocator>(camera_);
  if (allocator_->allocate(stream) < 0) return failed(fmt::format("{}: no memory for its frames", info_.name));
  for (const auto& buffer : allocator_->buffers(stream)) {
    const auto [mapped, fresh] = mappings_.try_emplace(buffer.get(), buffer->planes().front());
    auto request = camera_->createRequest();
    if (!mapped->second.valid() || !request || request->addBuffer(stream, buffer.get()) != 0) {
      return failed(fmt::format("{}: its frame buffers can't be used", info_.name));
    }
    requests_.push_back(std::move(request));
  }
  pool_ = std::make_shared<PixelPool>(static_cast<std::size_t>(info_.intrinsics.width) *
                                      static_cast<std::size_t>(info_.intrinsics.height));
  return {};
}

Expected<void> LibcameraSource::stream() {
  // On libcamera's thread: only handed over here.
  camera_->requestCompleted.connect(this, [this](libcamera::Request* request) {
    const std::lock_guard lock(mutex_);
    completed_.push_back(request);
    changed_.notify_all();
  });
  if (camera_->start() != 0) return failed(fmt::format("{}: does not start", info_.name));
  started_ = true;
  for (const auto& request : requests_) {
    if (camera_->queueRequest(request.get()) != 0) return failed(fmt::format("{}: takes no request", info_.name));
  }
  return {};
}

FrameOutcome LibcameraSource::next(DepthFrame& frame, milliseconds patience) {
  const auto deadline = steady_clock::now() + patience;
  while (true) {
    libcamera::Request* request = nullptr;
    {
      std::unique_lock lock(mutex_);
      changed_.wait_until(lock, deadline, [this] { return disconnected_ || !completed_.empty(); });
      // Its queued requests are never completed: the signal is all there is.
      if (disconnected_) return refuse(FrameOutcome::device_lost, "the camera was unplugged");
      if (completed_.empty()) return FrameOutcome::timeout;
      request = completed_.front();
      completed_.pop_front();
    }
    const FrameOutcome outcome = hand_over(*request, frame);
    request->reuse(libcamera::Request::ReuseBuffers);
    if (camera_->queueRequest(request) != 0) return refuse(FrameOutcome::device_lost, "the camera takes no request");
    if (outcome != FrameOutcome::timeout) return outcome;
  }
}

/// Copies the pixels, so that the buffer can go back at once. `timeout`: nothing to hand over, look again.
FrameOutcome LibcameraSource::hand_over(libcamera::Request& request, DepthFrame& frame) {
  if (request.status() != libcamera::Request::RequestComplete || request.buffers().empty()) {
    return FrameOutcome::timeout;
  }
  const libcamera::FrameBuffer& buffer = *request.buffers().begin()->second;
  const libcamera::FrameMetadata& metadata = buffer.metadata();
  const auto sequence = static_cast<std::int64_t>(metadata.sequence);
  if (!first_sequence_) {
    first_sequence_ = sequence;
  } else if (sequence <= last_sequence_) {
    return FrameOutcome::timeout;  // requests may complete out of order; it was counted as dropped then
  } else {
    dropped_ += sequence - last_sequence_ - 1;
  }
  last_sequence_ = sequence;
  frame = DepthFrame{};
  frame.received = steady_clock::now();
  frame.index = sequence - *first_sequence_;
  frame.metres_per_unit = info_.metres_per_unit;
  frame.width = info_.intrinsics.width;
  frame.height = info_.intrinsics.height;
  const double device_s = static_cast<double>(metadata.timestamp) / 1e9;
  const bool clock_stood_still = clock_.by_host();
  const auto stream_s = clock_.stamp(device_s, frame.received);
  if (clock_.by_host() && !clock_stood_still) {
    note_ = fmt::format("{}: the device's clock stands still at {:.6f} s; from frame {} on the host's is used",
                        info_.name, device_s, frame.index);
  }
  frame.timestamp_s = stream_s.value_or(clock_.shifted(device_s));
  const auto corrupt = [&](const std::string& why) {
    return refuse(FrameOutcome::corrupt, fmt::format("{}: frame {}: {}", info_.name, frame.index, why));
  };
  if (metadata.status != libcamera::FrameMetadata::FrameSuccess) return corrupt("the kernel marks it as broken");
  if (!stream_s) {
    return corrupt(fmt::format("timestamp_s went back from {:.6f} to {:.6f}", clock_.last_s(), frame.timestamp_s));
  }
  const std::size_t stride = configuration_->at(0).stride;
  const std::size_t needed =
      stride * (static_cast<std::size_t>(frame.height) - 1) + mono_row_bytes(packing_, frame.width);
  const LibcameraMapping& mapping = mappings_.at(&buffer);
  if (metadata.planes().empty() || metadata.planes()[0].bytesused < needed || mapping.size() < needed) {
    return corrupt(
        fmt::format("{} bytes, takes {}", metadata.planes().empty() ? 0 : metadata.planes()[0].bytesused, needed));
  }
  const auto pixels = pool_->take();
  unpack_mono(packing_, mapping.data(), stride, frame.width, frame.height, pixels.get());
  frame.pixels = pixels.get();
  frame.stride_bytes = static_cast<std::size_t>(frame.width) * sizeof(std::uint16_t);
  frame.keep_alive = pixels;
  return FrameOutcome::ok;
}

/// A manager that starts while a camera is being plugged in may see it twice, and then ends the program.
bool devices_are_changing() {
  struct stat devices = {};
  if (stat("/dev", &devices) != 0) return false;
  const auto changed = std::chrono::seconds(devices.st_mtim.tv_sec) + std::chrono::nanoseconds(devices.st_mtim.tv_nsec);
  const auto ago = std::chrono::system_clock::now().time_since_epoch() - changed;
  return ago >= milliseconds{0} && ago < milliseconds{500};
}

}  // namespace

Expected<std::unique_ptr<FrameSource>> open_libcamera(const std::string& id, const LibcameraOptions& options) {
  auto manager = LibcameraManager::start();
  if (!manager) return tl::make_unexpected(manager.error());
  auto source = std::make_unique<LibcameraSource>(std::move(*manager));
  if (auto started = source->start(id, options); !started) return tl::make_unexpected(started.error());
  return source;
}

Expected<std::unique_ptr<FrameSource>> open_libcamera_reconnecting(const std::string& id,
                                                                   const LibcameraOptions& options,
                                                                   const ReconnectOptions& reconnect) {
  auto first = open_libcamera(id, options);
  if (!first) return first;
  const std::string name = (*first)->info().name;
  auto reopen = [name, options]() -> Expected<std::unique_ptr<FrameSource>> {
    if (devices_are_changing()) return failed("libcamera: a device is just being plugged in");
    return open_libcamera(name.substr(name.find(':') + 1), options);
  };
  return reconnecting(std::move(*first), std::move(reopen), reconnect);
}

}  // namespace tubetrack
