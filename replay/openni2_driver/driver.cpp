// The virtual OpenNI2 device: glue between the runtime's driver interface and RecordingPlayer. It answers what real
// drivers answer (mode, field of view, mirroring, cropping, …), so every OpenNI2 program can use it.
#include <new>

#define XN_NEW(type, ...) new type(__VA_ARGS__)
#define XN_DELETE(pointer) delete (pointer)
#include <Driver/OniDriverAPI.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <string_view>
#include <type_traits>
#include <utility>

#include "recording_player.hpp"

namespace {

using tubetrack::StreamInfo;

constexpr char kUri[] = "virtual:0";
constexpr int kFps = 30;  // a mode must name one; frames come at the recording's own times

double metres_per_unit(OniPixelFormat format) {
  return format == ONI_PIXEL_FORMAT_DEPTH_100_UM ? 0.0001 : 0.001;
}

/// Both units OpenNI2 has, the one nearer to the recording's first: a program that doesn't ask gets that.
std::array<OniVideoMode, 2> modes_of(const StreamInfo& info) {
  const OniVideoMode mm{ONI_PIXEL_FORMAT_DEPTH_1_MM, info.intrinsics.width, info.intrinsics.height, kFps};
  OniVideoMode fine = mm;
  fine.pixelFormat = ONI_PIXEL_FORMAT_DEPTH_100_UM;
  if (info.metres_per_unit < 0.001 - 1e-9) return {fine, mm};
  return {mm, fine};
}

template <class T>
OniStatus put(const T& value, void* data, int* size) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (*size < static_cast<int>(sizeof(T))) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(data, &value, sizeof(T));
  *size = sizeof(T);
  return ONI_STATUS_OK;
}

template <class T>
OniStatus take(const void* data, int size, T& value) {
  if (size != static_cast<int>(sizeof(T))) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(&value, data, sizeof(T));
  return ONI_STATUS_OK;
}

bool same(const OniVideoMode& a, const OniVideoMode& b) {
  return a.pixelFormat == b.pixelFormat && a.resolutionX == b.resolutionX && a.resolutionY == b.resolutionY &&
         a.fps == b.fps;
}

class DepthStream final : public oni::driver::StreamBase {
 public:
  DepthStream(tubetrack::PlayerSettings settings, const StreamInfo& info, std::function<void()> unplug)
      : settings_(std::move(settings)), info_(info), unplug_(std::move(unplug)), mode_(modes_of(info)[0]) {}
  ~DepthStream() override { stop(); }

  OniStatus start() override {
    asked_since_start_ = false;
    player_ = std::make_unique<tubetrack::RecordingPlayer>(
        settings_, tubetrack::PlayerCallbacks{[this] { return asked_since_start_.load(); },
                                              [this](const tubetrack::DepthFrame& frame) { send(frame); }, unplug_});
    return ONI_STATUS_OK;
  }
  void stop() override { player_.reset(); }

  OniBool isPropertySupported(int id) override {
    return id >= ONI_STREAM_PROPERTY_CROPPING && id <= ONI_STREAM_PROPERTY_MIRRORING;
  }

  OniStatus getProperty(int id, void* data, int* size) override {
    asked_since_start_ = true;
    const std::lock_guard lock(mutex_);
    const tubetrack::Intrinsics& in = info_.intrinsics;
    switch (id) {
      case ONI_STREAM_PROPERTY_VIDEO_MODE:
        return put(mode_, data, size);
      case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
        return put(static_cast<float>(2.0 * std::atan(0.5 * in.width / in.fx_px)), data, size);
      case ONI_STREAM_PROPERTY_VERTICAL_FOV:
        return put(static_cast<float>(2.0 * std::atan(0.5 * in.height / in.fy_px)), data, size);
      case ONI_STREAM_PROPERTY_MAX_VALUE:
        return put(65535, data, size);
      case ONI_STREAM_PROPERTY_MIN_VALUE:
        return put(0, data, size);
      case ONI_STREAM_PROPERTY_MIRRORING:
        return put(mirrored_, data, size);
      case ONI_STREAM_PROPERTY_CROPPING:
        return put(cropping_, data, size);
      case ONI_STREAM_PROPERTY_STRIDE:
        return put(output_format().width * static_cast<int>(sizeof(OniDepthPixel)), data, size);
      default:
        return ONI_STATUS_NOT_SUPPORTED;
    }
  }

  OniStatus setProperty(int id, const void* data, int size) override {
    const std::lock_guard lock(mutex_);
    switch (id) {
      case ONI_STREAM_PROPERTY_VIDEO_MODE: {
        OniVideoMode wanted{};
        if (const OniStatus status = take(data, size, wanted); status != ONI_STATUS_OK) return status;
        const auto modes = modes_of(info_);
        if (std::none_of(modes.begin(), modes.end(), [&](const auto& mode) { return same(mode, wanted); })) {
          return ONI_STATUS_NOT_SUPPORTED;
        }
        mode_ = wanted;
        return ONI_STATUS_OK;
      }
      case ONI_STREAM_PROPERTY_MIRRORING:
        return take(data, size, mirrored_);
      case ONI_STREAM_PROPERTY_CROPPING: {
        OniCropping wanted{};
        if (const OniStatus status = take(data, size, wanted); status != ONI_STATUS_OK) return status;
        if (wanted.enabled &&
            (wanted.originX < 0 || wanted.originY < 0 || wanted.width < 1 || wanted.height < 1 ||
             wanted.width > mode_.resolutionX - wanted.originX || wanted.height > mode_.resolutionY - wanted.originY)) {
          return ONI_STATUS_BAD_PARAMETER;
        }
        cropping_ = wanted;
        return ONI_STATUS_OK;
      }
      default:
        return ONI_STATUS_NOT_SUPPORTED;
    }
  }

 private:
  /// With mutex_ held.
  tubetrack::OutputFormat output_format() const {
    tubetrack::OutputFormat format{
        metres_per_unit(mode_.pixelFormat), mirrored_ != FALSE, 0, 0, mode_.resolutionX, mode_.resolutionY};
    if (cropping_.enabled) {
      format.origin_u = cropping_.originX;
      format.origin_v = cropping_.originY;
      format.width = cropping_.width;
      format.height = cropping_.height;
    }
    return format;
  }

  void send(const tubetrack::DepthFrame& frame) {
    OniFrame* out = getServices().acquireFrame();
    if (out == nullptr) return;
    {
      const std::lock_guard lock(mutex_);
      const tubetrack::OutputFormat format = output_format();
      out->sensorType = ONI_SENSOR_DEPTH;
      out->videoMode = mode_;
      out->width = format.width;
      out->height = format.height;
      out->croppingEnabled = cropping_.enabled;
      out->cropOriginX = format.origin_u;
      out->cropOriginY = format.origin_v;
      out->stride = format.width * static_cast<int>(sizeof(OniDepthPixel));
      out->dataSize = out->stride * format.height;
      out->frameIndex = static_cast<int>(frame.index) + 1;
      out->timestamp = static_cast<std::uint64_t>(std::max(0LL, std::llround(frame.timestamp_s * 1e6)));
      tubetrack::write_pixels(frame, format, static_cast<std::uint16_t*>(out->data));
    }
    raiseNewFrame(out);  // not under the lock: the runtime may ask for properties from here
    getServices().releaseFrame(out);
  }

  tubetrack::PlayerSettings settings_;
  StreamInfo info_;
  std::function<void()> unplug_;
  std::mutex mutex_;
  OniVideoMode mode_;
  OniBool mirrored_ = TRUE;  // as PrimeSense's driver: a program that forgets to switch it off shall notice here
  OniCropping cropping_{};
  /// A program that asks a started stream for anything has come back from the runtime's `start`.
  std::atomic<bool> asked_since_start_ = false;
  std::unique_ptr<tubetrack::RecordingPlayer> player_;
};

class VirtualDevice final : public oni::driver::DeviceBase {
 public:
  VirtualDevice(tubetrack::PlayerSettings settings, StreamInfo info, std::function<void()> unplug)
      : settings_(std::move(settings)), info_(std::move(info)), unplug_(std::move(unplug)), modes_(modes_of(info_)) {
    sensor_.sensorType = ONI_SENSOR_DEPTH;
    sensor_.numSupportedVideoModes = static_cast<int>(modes_.size());
    sensor_.pSupportedVideoModes = modes_.data();
  }

  OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override {
    *sensors = &sensor_;
    *count = 1;
    return ONI_STATUS_OK;
  }
  oni::driver::StreamBase* createStream(OniSensorType type) override {
    return type == ONI_SENSOR_DEPTH ? new DepthStream(settings_, info_, unplug_) : nullptr;
  }
  void destroyStream(oni::driver::StreamBase* stream) override { delete stream; }
  OniBool isPropertySupported(int) override { return FALSE; }

 private:
  tubetrack::PlayerSettings settings_;
  StreamInfo info_;
  std::function<void()> unplug_;
  std::array<OniVideoMode, 2> modes_;
  OniSensorInfo sensor_{};
};

/// What the device can't say with a field of view alone; empty when that says it all.
std::string unsaid(const tubetrack::Intrinsics& in) {
  const bool centred =
      std::abs(in.cx_px - (in.width - 1) / 2.0) < 0.01 && std::abs(in.cy_px - (in.height - 1) / 2.0) < 0.01;
  if (centred && !in.has_distortion()) return {};
  return fmt::format(", needs --intrinsics {:.10g},{:.10g},{:.10g},{:.10g}{}", in.fx_px, in.fy_px, in.cx_px, in.cy_px,
                     in.has_distortion() ? ", has distortion that OpenNI2 can't say" : "");
}

class VirtualDriver final : public oni::driver::DriverBase {
 public:
  explicit VirtualDriver(OniDriverServices* services) : DriverBase(services) {
    std::strncpy(device_.uri, kUri, sizeof device_.uri - 1);
    std::strncpy(device_.vendor, "tubetrack", sizeof device_.vendor - 1);
  }

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback state_changed, void* cookie) override {
    DriverBase::initialize(connected, disconnected, state_changed, cookie);
    const auto settings = tubetrack::player_settings_from_environment();
    if (settings && settings->recording.empty()) return ONI_STATUS_OK;  // no recording, no device
    const auto opened = settings ? open(*settings) : tl::make_unexpected(settings.error());
    // A recording that can't be opened is listed all the same: its name and the attempt to open it say why.
    const std::string name =
        opened ? "recording " + settings->recording.filename().string() + unsaid(opened->source->info().intrinsics)
               : "unusable: " + opened.error().message;
    std::strncpy(device_.name, name.c_str(), sizeof device_.name - 1);
    deviceConnected(&device_);
    return ONI_STATUS_OK;
  }

  oni::driver::DeviceBase* deviceOpen(const char* uri, const char*) override {
    if (std::string_view(uri) != kUri) return nullptr;
    const auto settings = tubetrack::player_settings_from_environment();
    const auto opened = settings ? open(*settings) : tl::make_unexpected(settings.error());
    if (!opened) {
      getServices().errorLoggerAppend("%s", opened.error().message.c_str());
      return nullptr;
    }
    return new VirtualDevice(*settings, opened->source->info(), [this] { deviceDisconnected(&device_); });
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }
  void shutdown() override {}

 private:
  static tubetrack::Expected<tubetrack::OpenedRecording> open(const tubetrack::PlayerSettings& settings) {
    return tubetrack::open_recording(settings.recording, settings.options);
  }

  OniDeviceInfo device_{};
};

}  // namespace

ONI_EXPORT_DRIVER(VirtualDriver)
