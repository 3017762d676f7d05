#include "virtual_stream.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>
#include <type_traits>
#include <utility>

namespace tubetrack {

namespace {

constexpr int kFps = 30;  // a mode must name one; frames come at the recording's own times

double metres_per_unit(OniPixelFormat format) {
  return format == ONI_PIXEL_FORMAT_DEPTH_100_UM ? 0.0001 : 0.001;
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

}  // namespace

std::vector<OniVideoMode> modes_of(const StreamInfo& info) {
  const OniVideoMode mm{ONI_PIXEL_FORMAT_DEPTH_1_MM, info.intrinsics.width, info.intrinsics.height, kFps};
  OniVideoMode fine = mm;
  fine.pixelFormat = ONI_PIXEL_FORMAT_DEPTH_100_UM;
  std::vector<OniVideoMode> modes = {mm, fine};
  if (info.metres_per_unit < 0.001 - 1e-9) std::swap(modes[0], modes[1]);
  if (mm.resolutionX % 2 == 0 && mm.resolutionY % 2 == 0) {
    for (int i = 0; i < 2; ++i) {
      OniVideoMode half = modes[static_cast<std::size_t>(i)];
      half.resolutionX /= 2;
      half.resolutionY /= 2;
      modes.push_back(half);
    }
  }
  return modes;
}

VirtualStream::VirtualStream(PlayerSettings settings, const StreamInfo& info, Faults& faults, Cable& cable)
    : settings_(std::move(settings)), info_(info), faults_(faults), cable_(cable), mode_(modes_of(info)[0]) {}

VirtualStream::~VirtualStream() {
  stop();
}

OniStatus VirtualStream::start() {
  asked_since_start_ = false;
  player_ = std::make_unique<RecordingPlayer>(
      settings_, PlayerCallbacks{[this] { return asked_since_start_.load(); },
                                 [this](const DepthFrame& frame, bool cut) { send(frame, cut); },
                                 [this] { return faults_.next_turn(); },
                                 [this](double back_after_s) { cable_.unplug(back_after_s); }});
  return ONI_STATUS_OK;
}

void VirtualStream::stop() {
  std::this_thread::sleep_for(std::chrono::duration<double>(faults_.take_hang_s()));
  player_.reset();
}

OniBool VirtualStream::isPropertySupported(int id) {
  return id >= ONI_STREAM_PROPERTY_CROPPING && id <= ONI_STREAM_PROPERTY_MIRRORING;
}

OniStatus VirtualStream::getProperty(int id, void* data, int* size) {
  asked_since_start_ = true;
  const std::lock_guard lock(mutex_);
  const Intrinsics& in = info_.intrinsics;
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

OniStatus VirtualStream::setProperty(int id, const void* data, int size) {
  const std::lock_guard lock(mutex_);
  switch (id) {
    case ONI_STREAM_PROPERTY_VIDEO_MODE: {
      OniVideoMode wanted{};
      const OniStatus taken = take(data, size, wanted);
      return taken == ONI_STATUS_OK ? set_mode(wanted) : taken;
    }
    case ONI_STREAM_PROPERTY_MIRRORING:
      return settings_.always_mirrored ? ONI_STATUS_NOT_SUPPORTED : take(data, size, mirrored_);
    case ONI_STREAM_PROPERTY_CROPPING: {
      OniCropping wanted{};
      const OniStatus taken = take(data, size, wanted);
      return taken == ONI_STATUS_OK ? set_cropping(wanted) : taken;
    }
    default:
      return ONI_STATUS_NOT_SUPPORTED;
  }
}

/// With mutex_ held, as the next two.
OniStatus VirtualStream::set_mode(const OniVideoMode& wanted) {
  const auto modes = modes_of(info_);
  if (std::none_of(modes.begin(), modes.end(), [&](const auto& mode) { return same(mode, wanted); })) {
    return ONI_STATUS_NOT_SUPPORTED;
  }
  mode_ = wanted;
  return ONI_STATUS_OK;
}

OniStatus VirtualStream::set_cropping(const OniCropping& wanted) {
  if (wanted.enabled &&
      (wanted.originX < 0 || wanted.originY < 0 || wanted.width < 1 || wanted.height < 1 ||
       wanted.width > mode_.resolutionX - wanted.originX || wanted.height > mode_.resolutionY - wanted.originY)) {
    return ONI_STATUS_BAD_PARAMETER;
  }
  cropping_ = wanted;
  return ONI_STATUS_OK;
}

OutputFormat VirtualStream::output_format() const {
  OutputFormat format;
  format.metres_per_unit = metres_per_unit(mode_.pixelFormat);
  format.mirrored = mirrored_ != FALSE;
  format.step = info_.intrinsics.width / mode_.resolutionX;
  format.width = mode_.resolutionX;
  format.height = mode_.resolutionY;
  if (cropping_.enabled) {
    format.origin_u = cropping_.originX;
    format.origin_v = cropping_.originY;
    format.width = cropping_.width;
    format.height = cropping_.height;
  }
  return format;
}

void VirtualStream::send(const DepthFrame& frame, bool cut) {
  if (!cable_.plugged_in()) return;
  OniFrame* out = getServices().acquireFrame();
  if (out == nullptr) return;
  {
    const std::lock_guard lock(mutex_);
    OutputFormat format = output_format();
    if (cut) format.height /= 2;
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
    write_pixels(frame, format, static_cast<std::uint16_t*>(out->data));
  }
  raiseNewFrame(out);  // not under the lock: the runtime may ask for properties from here
  getServices().releaseFrame(out);
}

}  // namespace tubetrack
