#include "tubetrack/sensors/openni2_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <thread>
#include <utility>

#include "oni_structure.hpp"
#include "openni2_runtime.hpp"
#include "pixel_pool.hpp"
#include "stream_clock.hpp"

namespace tubetrack {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// One open depth stream. Members are in the order they must be taken down in, last first.
class OpenNi2Source final : public FrameSource {
 public:
  OpenNi2Source(std::shared_ptr<OpenNi2Runtime> runtime, const std::string& uri)
      : runtime_(std::move(runtime)), listener_(uri) {
    info_.name = uri;
  }

  ~OpenNi2Source() override {
    stream_.stop();
    if (recorder_.isValid()) {
      wait_for_recorder();
      recorder_.stop();
      recorder_.destroy();
    }
    stream_.destroy();
    device_.close();
  }

  Expected<void> start(const OpenNi2Options& options);

  const StreamInfo& info() const override { return info_; }
  FrameOutcome next(DepthFrame& frame, milliseconds patience) override;
  const std::string& last_problem() const override { return problem_; }
  std::string take_note() override { return std::exchange(note_, {}); }
  std::int64_t dropped() const override { return dropped_; }

 private:
  Expected<void> start_recording(const std::filesystem::path& path);
  void wait_for_recorder() const;
  FrameOutcome hand_over(const openni::VideoFrameRef& device_frame, DepthFrame& frame);
  FrameOutcome refuse(FrameOutcome outcome, std::string problem) {
    problem_ = std::move(problem);
    return outcome;
  }

  std::shared_ptr<OpenNi2Runtime> runtime_;
  UnplugListener listener_;
  openni::Device device_;
  openni::VideoStream stream_;
  openni::Recorder recorder_;
  StreamInfo info_;
  std::filesystem::path recording_;
  std::int64_t seen_ = 0;
  bool mirrored_ = false;
  std::shared_ptr<PixelPool> pool_;
  std::string problem_;
  std::string note_;
  std::int64_t dropped_ = 0;
  std::optional<int> first_index_;
  int last_index_ = 0;
  StreamClock clock_;
};

Expected<void> OpenNi2Source::start(const OpenNi2Options& options) {
  if (device_.open(info_.name.c_str()) != openni::STATUS_OK) {
    return openni2_failed(fmt::format("{}: can't open the OpenNI2 device: {}", info_.name, openni2_says()));
  }
  // Only now: asking a device that failed to open for its sensors crashes the runtime.
  if (!device_.hasSensor(openni::SENSOR_DEPTH)) {
    return openni2_failed(
        fmt::format("{}: this device has no depth sensor; `tubetrack devices` lists the others", info_.name));
  }
  info_.device = fmt::format("{} {}", device_.getDeviceInfo().getVendor(), device_.getDeviceInfo().getName());
  if (stream_.create(device_, openni::SENSOR_DEPTH) != openni::STATUS_OK) {
    return openni2_failed(fmt::format("{}: can't create the depth stream: {}", info_.name, openni2_says()));
  }
  if (auto set = set_up_openni2_stream(stream_, options, info_, mirrored_); !set) return set;
  const auto intrinsics = openni2_intrinsics(stream_, options, info_.name);
  if (!intrinsics) return tl::make_unexpected(intrinsics.error());
  info_.intrinsics = *intrinsics;
  pool_ = std::make_shared<PixelPool>(static_cast<std::size_t>(intrinsics->width) *
                                      static_cast<std::size_t>(intrinsics->height));
  if (!options.record_oni.empty()) {
    if (auto recording = start_recording(options.record_oni); !recording) return recording;
  }
  if (stream_.start() != openni::STATUS_OK) {
    return openni2_failed(fmt::format("{}: the depth stream did not start: {}", info_.name, openni2_says()));
  }
  // Asked of the running stream: what counts is what the frames will be.
  mirrored_ = stream_.getMirroringEnabled();
  return {};
}

Expected<void> OpenNi2Source::start_recording(const std::filesystem::path& path) {
  if (recorder_.create(path.c_str()) != openni::STATUS_OK || recorder_.attach(stream_) != openni::STATUS_OK ||
      recorder_.start() != openni::STATUS_OK) {
    return openni2_failed(
        fmt::format("{}: can't be recorded to: {}; give a file in a folder that can be written, ending in .oni",
                    path.string(), openni2_says()));
  }
  recording_ = path;
  // It begins on a thread of its own, and what comes before is lost.
  for (int i = 0; i < 200 && !oni_takes_frames(path); ++i) std::this_thread::sleep_for(milliseconds{10});
  return {};
}

/// The runtime's recorder writes on a thread of its own, and stopping it throws away what that has not come to. It has
/// at least what we have seen; one that writes nothing for a second is not waited for.
void OpenNi2Source::wait_for_recorder() const {
  constexpr milliseconds kLook{50};
  std::uintmax_t last_bytes = 0;
  for (milliseconds quiet{0}; quiet < milliseconds{1000}; quiet += kLook) {
    std::error_code ignored;
    const std::uintmax_t bytes = std::filesystem::file_size(recording_, ignored);
    if (bytes == last_bytes && oni_frames_so_far(recording_) >= seen_) return;
    if (bytes != last_bytes) quiet = milliseconds{0};
    last_bytes = bytes;
    std::this_thread::sleep_for(kLook);
  }
}

FrameOutcome OpenNi2Source::next(DepthFrame& frame, milliseconds patience) {
  // In slices: an unplugged device never wakes the wait, so it is noticed here within one.
  constexpr milliseconds kSlice{50};
  const auto deadline = steady_clock::now() + patience;
  while (true) {
    if (listener_.unplugged()) return refuse(FrameOutcome::device_lost, "the device was unplugged");
    const auto left = std::chrono::ceil<milliseconds>(deadline - steady_clock::now());
    const int wait_ms = static_cast<int>(std::clamp(left, milliseconds{0}, kSlice).count());
    openni::VideoStream* stream = &stream_;
    int ready = -1;
    const openni::Status waited = openni::OpenNI::waitForAnyStream(&stream, 1, &ready, wait_ms);
    if (waited == openni::STATUS_OK) break;
    if (waited != openni::STATUS_TIME_OUT) {
      return refuse(FrameOutcome::device_lost, "waiting for a frame failed: " + openni2_says());
    }
    if (left <= milliseconds{0}) return FrameOutcome::timeout;
  }
  openni::VideoFrameRef device_frame;
  if (stream_.readFrame(&device_frame) != openni::STATUS_OK || !device_frame.isValid()) {
    return refuse(FrameOutcome::device_lost, "reading a frame failed: " + openni2_says());
  }
  return hand_over(device_frame, frame);
}

/// Copies the device's frame. Not the runtime's own buffer: letting go of one of those while its stream closes on
/// another thread races inside the runtime, and after shutdown it is a use after free.
FrameOutcome OpenNi2Source::hand_over(const openni::VideoFrameRef& device_frame, DepthFrame& frame) {
  const int index = device_frame.getFrameIndex();
  if (!first_index_) {
    first_index_ = index;
  } else if (index > last_index_ + 1) {
    dropped_ += index - last_index_ - 1;
  } else if (index <= last_index_) {
    *first_index_ += index - last_index_ - 1;  // the device counts anew: ours goes on
  }
  last_index_ = index;
  ++seen_;
  frame = DepthFrame{};
  frame.received = steady_clock::now();
  frame.index = static_cast<std::int64_t>(index) - *first_index_;
  frame.metres_per_unit = info_.metres_per_unit;
  frame.width = info_.intrinsics.width;
  frame.height = info_.intrinsics.height;
  const double device_s = static_cast<double>(device_frame.getTimestamp()) / 1e6;
  const bool clock_stood_still = clock_.by_host();
  const auto stream_s = clock_.stamp(device_s, frame.received);
  if (clock_.by_host() && !clock_stood_still) {
    note_ = fmt::format("{}: the device's clock stands still at {:.6f} s; from frame {} on the host's is used",
                        info_.name, device_s, frame.index);
  }
  frame.timestamp_s = stream_s.value_or(clock_.shifted(device_s));
  if (!stream_s) {
    return refuse(FrameOutcome::corrupt, fmt::format("{}: frame {}: timestamp_s went back from {:.6f} to {:.6f}",
                                                     info_.name, frame.index, clock_.last_s(), frame.timestamp_s));
  }
  if (auto problem = openni2_frame_problem(device_frame, info_.intrinsics); !problem.empty()) {
    return refuse(FrameOutcome::corrupt, fmt::format("{}: frame {}: {}", info_.name, frame.index, problem));
  }
  const auto pixels = pool_->take();
  copy_openni2_pixels(device_frame, info_.intrinsics, mirrored_, pixels.get());
  frame.pixels = pixels.get();
  frame.stride_bytes = static_cast<std::size_t>(frame.width) * sizeof(std::uint16_t);
  frame.keep_alive = pixels;
  return FrameOutcome::ok;
}

/// The URI up to the place where it is plugged in: "1d27/0600@1/5" is another after each plugging in.
std::string kind_of(const std::string& uri) {
  return uri.substr(0, uri.find('@'));
}

/// The device of that URI, or else the only one of its kind.
std::string uri_now(const std::string& uri) {
  std::vector<std::string> alike;
  for (const DeviceDescription& device : openni2_devices_now()) {
    if (device.uri == uri) return uri;
    if (kind_of(device.uri) == kind_of(uri)) alike.push_back(device.uri);
  }
  return alike.size() == 1 ? alike.front() : uri;
}

/// The runtime's recorder crashes where it can't make its file.
Expected<void> check_writable(const std::filesystem::path& path) {
  if (path.empty()) return {};
  std::error_code ignored;
  const bool folder = std::filesystem::is_directory(path, ignored);
  if (!folder && std::ofstream(path, std::ios::app)) return {};
  return tl::make_unexpected(Error::usage(fmt::format("{}: {}; give a file in an existing folder", path.string(),
                                                      folder ? "is a folder" : std::strerror(errno))));
}

Expected<std::unique_ptr<FrameSource>> open_with(std::shared_ptr<OpenNi2Runtime> runtime, const std::string& uri,
                                                 const OpenNi2Options& options) {
  if (auto writable = check_writable(options.record_oni); !writable) return tl::make_unexpected(writable.error());
  auto source = std::make_unique<OpenNi2Source>(std::move(runtime), uri);
  if (auto started = source->start(options); !started) return tl::make_unexpected(started.error());
  return source;
}

/// `desk.oni`, then `desk-2.oni` …: a file ends with the device it is of.
std::filesystem::path numbered(const std::filesystem::path& path, int piece) {
  if (path.empty() || piece == 1) return path;
  return path.parent_path() / fmt::format("{}-{}{}", path.stem().string(), piece, path.extension().string());
}

}  // namespace

Expected<std::unique_ptr<FrameSource>> open_openni2(const std::string& uri, const OpenNi2Options& options) {
  auto runtime = use_openni2();
  if (!runtime) return tl::make_unexpected(runtime.error());
  const auto devices = openni2_devices_now();
  if (uri.empty() && devices.empty()) {
    return openni2_failed(
        "no OpenNI2 device found; plugged in? `tubetrack devices` lists them; without a sensor: "
        "scripts/virtual-device RECORDING tubetrack live");
  }
  return open_with(std::move(*runtime), uri.empty() ? devices.front().uri : uri, options);
}

Expected<std::unique_ptr<FrameSource>> open_openni2_reconnecting(const std::string& uri, const OpenNi2Options& options,
                                                                 const ReconnectOptions& reconnect) {
  auto first = open_openni2(uri, options);
  if (!first) return first;
  // The runtime stays up while the device is away: it is what hears that it is back.
  auto runtime = use_openni2();
  if (!runtime) return tl::make_unexpected(runtime.error());
  auto reopen = [held = *runtime, name = (*first)->info().name, options,
                 piece = 1]() mutable -> Expected<std::unique_ptr<FrameSource>> {
    OpenNi2Options again = options;
    again.record_oni = numbered(options.record_oni, piece + 1);
    auto opened = open_with(held, uri_now(name), again);
    if (opened) ++piece;
    return opened;
  };
  return reconnecting(std::move(*first), std::move(reopen), reconnect);
}

}  // namespace tubetrack
