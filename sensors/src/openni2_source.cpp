#include "tubetrack/sensors/openni2_source.hpp"

#include <OpenNI.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <mutex>
#include <tuple>
#include <utility>

#include "pixel_pool.hpp"

namespace tubetrack {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// The runtime's own words for the last error, as one line.
std::string runtime_says() {
  std::string text = openni::OpenNI::getExtendedError();
  std::replace(text.begin(), text.end(), '\n', ' ');
  text.erase(0, text.find_first_not_of(" \t"));
  text.erase(text.find_last_not_of(" \t") + 1);
  return text.empty() ? "the runtime gives no reason" : text;
}

tl::unexpected<Error> failed(std::string text) {
  return tl::make_unexpected(Error::failed(std::move(text)));
}

/// The initialised runtime, shared by everything open; the last user shuts it down.
struct Runtime {
  ~Runtime() { openni::OpenNI::shutdown(); }
};

Expected<std::shared_ptr<Runtime>> use_runtime() {
  static std::mutex mutex;
  static std::weak_ptr<Runtime> running;
  const std::lock_guard lock(mutex);
  if (auto runtime = running.lock()) return runtime;
  if (openni::OpenNI::initialize() != openni::STATUS_OK) {
    // Without a driver the runtime fails with an empty text, so the likely cause is said here.
    return failed(
        fmt::format("OpenNI2: the runtime did not start ({}); it looks for OpenNI2/Drivers/lib*.so.0 beside the "
                    "libOpenNI2.so.0 that "
                    "was loaded; install libopenni2-0, or put a complete folder first in LD_LIBRARY_PATH",
                    runtime_says()));
  }
  auto runtime = std::make_shared<Runtime>();
  running = runtime;
  return runtime;
}

/// Hears that a device was unplugged: `isValid()` stays true then, and waits only time out.
class UnplugListener final : public openni::OpenNI::DeviceDisconnectedListener {
 public:
  explicit UnplugListener(std::string uri) : uri_(std::move(uri)) {
    openni::OpenNI::addDeviceDisconnectedListener(this);
  }
  ~UnplugListener() override { openni::OpenNI::removeDeviceDisconnectedListener(this); }
  UnplugListener(const UnplugListener&) = delete;
  UnplugListener& operator=(const UnplugListener&) = delete;

  bool unplugged() const { return unplugged_; }

 private:
  void onDeviceDisconnected(const openni::DeviceInfo* info) override {
    if (uri_ == info->getUri()) unplugged_ = true;
  }

  std::string uri_;
  std::atomic<bool> unplugged_ = false;
};

/// Metres per unit of a depth format; 0 for formats that are no depth in metres (raw shifts).
double metres_per_unit(openni::PixelFormat format) {
  if (format == openni::PIXEL_FORMAT_DEPTH_1_MM) return 0.001;
  if (format == openni::PIXEL_FORMAT_DEPTH_100_UM) return 0.0001;
  return 0.0;
}

std::string describe(const openni::VideoMode& mode) {
  return fmt::format("{}x{}@{} {}", mode.getResolutionX(), mode.getResolutionY(), mode.getFps(),
                     metres_per_unit(mode.getPixelFormat()) == 0.001 ? "1 mm" : "100 um");
}

bool fits(const openni::VideoMode& mode, const OpenNi2Options& want) {
  const double unit = metres_per_unit(mode.getPixelFormat());
  return unit > 0.0 && (want.width == 0 || mode.getResolutionX() == want.width) &&
         (want.height == 0 || mode.getResolutionY() == want.height) && (want.fps == 0 || mode.getFps() == want.fps) &&
         (want.metres_per_unit == 0.0 || std::abs(unit - want.metres_per_unit) < 1e-9);
}

/// The offered mode that fits and comes nearest to 640×480 at 30, then to what the device has set.
Expected<openni::VideoMode> choose_mode(const std::string& name, const openni::VideoStream& stream,
                                        const OpenNi2Options& want) {
  const openni::VideoMode current = stream.getVideoMode();
  const auto preference = [&](const openni::VideoMode& mode) {
    return std::tuple(mode.getResolutionX() == 640 && mode.getResolutionY() == 480,
                      mode.getResolutionX() == current.getResolutionX(), -std::abs(mode.getFps() - 30),
                      mode.getPixelFormat() == current.getPixelFormat());
  };
  const auto& offered = stream.getSensorInfo().getSupportedVideoModes();
  const openni::VideoMode* best = nullptr;
  std::string list;
  for (int i = 0; i < offered.getSize(); ++i) {
    if (metres_per_unit(offered[i].getPixelFormat()) == 0.0) continue;
    list += (list.empty() ? "" : ", ") + describe(offered[i]);
    if (fits(offered[i], want) && (best == nullptr || preference(offered[i]) > preference(*best))) best = &offered[i];
  }
  if (best == nullptr) {
    return failed(fmt::format("{}: no depth mode like {}x{}@{} unit {:g} m (0: any); the device offers {}", name,
                              want.width, want.height, want.fps, want.metres_per_unit, list.empty() ? "none" : list));
  }
  return *best;
}

/// One open depth stream. Members are in the order they must be taken down in, last first.
class OpenNi2Source final : public FrameSource {
 public:
  OpenNi2Source(std::shared_ptr<Runtime> runtime, const std::string& uri)
      : runtime_(std::move(runtime)), listener_(uri) {
    info_.name = uri;
  }

  ~OpenNi2Source() override {
    stream_.stop();
    stream_.destroy();
    device_.close();
  }

  Expected<void> start(const OpenNi2Options& options);

  const StreamInfo& info() const override { return info_; }
  FrameOutcome next(DepthFrame& frame, milliseconds patience) override;
  const std::string& last_problem() const override { return problem_; }
  std::int64_t dropped() const override { return dropped_; }

 private:
  Expected<void> set_mode(const OpenNi2Options& options);
  Expected<void> read_intrinsics(const OpenNi2Options& options);
  FrameOutcome hand_over(const openni::VideoFrameRef& device_frame, DepthFrame& frame);
  FrameOutcome refuse(FrameOutcome outcome, std::string problem) {
    problem_ = std::move(problem);
    return outcome;
  }

  std::shared_ptr<Runtime> runtime_;
  UnplugListener listener_;
  openni::Device device_;
  openni::VideoStream stream_;
  StreamInfo info_;
  std::shared_ptr<PixelPool> pool_;
  std::string problem_;
  std::int64_t dropped_ = 0;
  std::optional<int> first_index_;
  int last_index_ = 0;
  double last_timestamp_s_ = 0.0;
};

Expected<void> OpenNi2Source::start(const OpenNi2Options& options) {
  if (device_.open(info_.name.c_str()) != openni::STATUS_OK) {
    return failed(fmt::format("{}: can't open the OpenNI2 device: {}", info_.name, runtime_says()));
  }
  // Only now: asking a device that failed to open for its sensors crashes the runtime.
  if (!device_.hasSensor(openni::SENSOR_DEPTH)) {
    return failed(fmt::format("{}: this device has no depth sensor; `tubetrack devices` lists the others", info_.name));
  }
  info_.device = fmt::format("{} {}", device_.getDeviceInfo().getVendor(), device_.getDeviceInfo().getName());
  if (stream_.create(device_, openni::SENSOR_DEPTH) != openni::STATUS_OK) {
    return failed(fmt::format("{}: can't create the depth stream: {}", info_.name, runtime_says()));
  }
  if (auto set = set_mode(options); !set) return set;
  if (auto read = read_intrinsics(options); !read) return read;
  if (stream_.start() != openni::STATUS_OK) {
    return failed(fmt::format("{}: the depth stream did not start: {}", info_.name, runtime_says()));
  }
  // Asked of the running stream: what counts is what the frames will be.
  if (stream_.getMirroringEnabled()) {
    return failed(fmt::format("{}: mirroring is on and the device does not switch it off", info_.name));
  }
  return {};
}

Expected<void> OpenNi2Source::set_mode(const OpenNi2Options& options) {
  const auto mode = choose_mode(info_.name, stream_, options);
  if (!mode) return tl::make_unexpected(mode.error());
  if (stream_.setVideoMode(*mode) != openni::STATUS_OK) {
    return failed(
        fmt::format("{}: the device refused its own mode {}: {}", info_.name, describe(*mode), runtime_says()));
  }
  info_.metres_per_unit = metres_per_unit(mode->getPixelFormat());
  info_.intrinsics.width = mode->getResolutionX();
  info_.intrinsics.height = mode->getResolutionY();
  pool_ = std::make_shared<PixelPool>(static_cast<std::size_t>(mode->getResolutionX()) *
                                      static_cast<std::size_t>(mode->getResolutionY()));
  // The default is each driver's own (PrimeSense's is on), and a mirrored scene has its bends the wrong way round.
  stream_.setMirroringEnabled(false);
  return {};
}

Expected<void> OpenNi2Source::read_intrinsics(const OpenNi2Options& options) {
  Intrinsics& in = info_.intrinsics;
  if (options.intrinsics_px) {
    in.fx_px = (*options.intrinsics_px)[0];
    in.fy_px = (*options.intrinsics_px)[1];
    in.cx_px = (*options.intrinsics_px)[2];
    in.cy_px = (*options.intrinsics_px)[3];
  } else {
    const double horizontal_rad = static_cast<double>(stream_.getHorizontalFieldOfView());
    const double vertical_rad = static_cast<double>(stream_.getVerticalFieldOfView());
    in = intrinsics_from_field_of_view(in.width, in.height, horizontal_rad, vertical_rad);
    // An angle said as a float holds f to some 1e-4 px. Rounded to 1e-3 px, what was a round number is one again: so a
    // recording played by the virtual device gives the very bytes that it gives when read from disk.
    in.fx_px = std::round(in.fx_px * 1e3) / 1e3;
    in.fy_px = std::round(in.fy_px * 1e3) / 1e3;
  }
  if (const auto valid = validate(in); !valid) {
    return failed(fmt::format("{}: {}; the device's field of view can't be used, give --intrinsics fx,fy,cx,cy",
                              info_.name, valid.error().message));
  }
  return {};
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
      return refuse(FrameOutcome::device_lost, "waiting for a frame failed: " + runtime_says());
    }
    if (left <= milliseconds{0}) return FrameOutcome::timeout;
  }
  openni::VideoFrameRef device_frame;
  if (stream_.readFrame(&device_frame) != openni::STATUS_OK || !device_frame.isValid()) {
    return refuse(FrameOutcome::device_lost, "reading a frame failed: " + runtime_says());
  }
  return hand_over(device_frame, frame);
}

/// Copies the device's frame, row by row since its stride is the driver's. Not the runtime's own buffer: letting go of
/// one of those while its stream closes on another thread races inside the runtime, and after shutdown it is a use
/// after free.
FrameOutcome OpenNi2Source::hand_over(const openni::VideoFrameRef& device_frame, DepthFrame& frame) {
  const int index = device_frame.getFrameIndex();
  if (!first_index_) {
    first_index_ = index;
  } else if (index > last_index_ + 1) {
    dropped_ += index - last_index_ - 1;
  }
  last_index_ = index;
  frame = DepthFrame{};
  frame.index = static_cast<std::int64_t>(index) - *first_index_;
  frame.timestamp_s = static_cast<double>(device_frame.getTimestamp()) / 1e6;
  frame.metres_per_unit = info_.metres_per_unit;
  frame.width = info_.intrinsics.width;
  frame.height = info_.intrinsics.height;
  if (frame.index > 0 && frame.timestamp_s <= last_timestamp_s_) {
    return refuse(FrameOutcome::corrupt, fmt::format("{}: frame {}: timestamp_s went back from {:.6f} to {:.6f}",
                                                     info_.name, frame.index, last_timestamp_s_, frame.timestamp_s));
  }
  last_timestamp_s_ = frame.timestamp_s;
  const std::size_t row_bytes = static_cast<std::size_t>(frame.width) * sizeof(std::uint16_t);
  const std::size_t stride = static_cast<std::size_t>(std::max(device_frame.getStrideInBytes(), 0));
  const std::size_t rows = static_cast<std::size_t>(frame.height);
  if (device_frame.getWidth() != frame.width || device_frame.getHeight() != frame.height || stride < row_bytes ||
      static_cast<std::size_t>(device_frame.getDataSize()) < stride * (rows - 1) + row_bytes) {
    return refuse(FrameOutcome::corrupt, fmt::format("{}: frame {}: {}x{} in {} bytes instead of {}x{}", info_.name,
                                                     frame.index, device_frame.getWidth(), device_frame.getHeight(),
                                                     device_frame.getDataSize(), frame.width, frame.height));
  }
  const auto pixels = pool_->take();
  const auto* from = static_cast<const std::byte*>(device_frame.getData());
  for (std::size_t v = 0; v < rows; ++v) {
    std::memcpy(pixels.get() + v * static_cast<std::size_t>(frame.width), from + v * stride, row_bytes);
  }
  frame.pixels = pixels.get();
  frame.stride_bytes = row_bytes;
  frame.keep_alive = pixels;
  return FrameOutcome::ok;
}

std::vector<DeviceDescription> devices_now() {
  openni::Array<openni::DeviceInfo> found;
  openni::OpenNI::enumerateDevices(&found);
  std::vector<DeviceDescription> devices;
  devices.reserve(static_cast<std::size_t>(found.getSize()));
  for (int i = 0; i < found.getSize(); ++i) {
    devices.push_back({found[i].getUri(), found[i].getVendor(), found[i].getName()});
  }
  return devices;
}

}  // namespace

Expected<std::vector<DeviceDescription>> list_openni2_devices() {
  const auto runtime = use_runtime();
  if (!runtime) return tl::make_unexpected(runtime.error());
  return devices_now();
}

Expected<std::unique_ptr<FrameSource>> open_openni2(const std::string& uri, const OpenNi2Options& options) {
  auto runtime = use_runtime();
  if (!runtime) return tl::make_unexpected(runtime.error());
  const auto devices = devices_now();
  if (uri.empty() && devices.empty()) {
    return failed(
        "no OpenNI2 device found; plugged in? `tubetrack devices` lists them; without a sensor: "
        "scripts/virtual-device RECORDING tubetrack live");
  }
  auto source = std::make_unique<OpenNi2Source>(std::move(*runtime), uri.empty() ? devices.front().uri : uri);
  if (auto started = source->start(options); !started) return tl::make_unexpected(started.error());
  return source;
}

}  // namespace tubetrack
