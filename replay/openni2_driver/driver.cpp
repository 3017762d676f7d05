// The virtual OpenNI2 device: a driver that the real runtime loads and that plays a recording, so that every OpenNI2
// program can use it. Here are the driver and the device; virtual_stream has the frames.
#include <new>

#define XN_NEW(type, ...) new type(__VA_ARGS__)
#define XN_DELETE(pointer) delete (pointer)
#include <Driver/OniDriverAPI.h>
#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "virtual_stream.hpp"

namespace {

using tubetrack::StreamInfo;

constexpr char kUri[] = "virtual:0";

/// What the streams of this driver share; the faults go on where they were when the device is opened again.
struct Bench {
  tubetrack::Faults faults;
  tubetrack::Cable cable;
};

class VirtualDevice final : public oni::driver::DeviceBase {
 public:
  VirtualDevice(tubetrack::PlayerSettings settings, StreamInfo info, Bench& bench)
      : settings_(std::move(settings)), info_(std::move(info)), bench_(bench), modes_(tubetrack::modes_of(info_)) {
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
    if (type != ONI_SENSOR_DEPTH) return nullptr;
    return new tubetrack::VirtualStream(settings_, info_, bench_.faults, bench_.cable);
  }
  void destroyStream(oni::driver::StreamBase* stream) override { delete stream; }
  OniBool isPropertySupported(int) override { return FALSE; }
  OniBool isCommandSupported(int id) override { return tubetrack::fault_of_command(id, 0) ? TRUE : FALSE; }

  OniStatus invoke(int id, void* data, int size) override {
    std::int32_t value = 0;
    if (size != static_cast<int>(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
    std::memcpy(&value, data, sizeof value);
    const auto fault = tubetrack::fault_of_command(id, value);
    if (!fault) return ONI_STATUS_NOT_SUPPORTED;
    if (fault->kind == tubetrack::FaultKind::unplug) {
      bench_.cable.unplug(fault->amount);
    } else if (fault->kind == tubetrack::FaultKind::replug) {
      bench_.cable.replug();
    } else {
      bench_.faults.order(*fault);
    }
    return ONI_STATUS_OK;
  }

 private:
  tubetrack::PlayerSettings settings_;
  StreamInfo info_;
  Bench& bench_;
  std::vector<OniVideoMode> modes_;
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
    auto script = read_script(settings);
    const auto opened = script ? open(*settings) : tl::make_unexpected(script.error());
    bench_.reset(new Bench{tubetrack::Faults(script ? std::move(*script) : std::vector<tubetrack::Fault>()),
                           {[this] { deviceDisconnected(&device_); }, [this] { deviceConnected(&device_); }}});
    // A recording that can't be opened is listed all the same: its name and the attempt to open it say why.
    const std::string name =
        opened ? "recording " + settings->recording.filename().string() + unsaid(opened->source->info().intrinsics)
               : "unusable: " + opened.error().message;
    std::strncpy(device_.name, name.c_str(), sizeof device_.name - 1);
    deviceConnected(&device_);
    return ONI_STATUS_OK;
  }

  oni::driver::DeviceBase* deviceOpen(const char* uri, const char*) override {
    if (std::string_view(uri) != kUri || !bench_) return nullptr;
    if (!bench_->cable.plugged_in()) return refuse("the virtual device is unplugged");
    const auto settings = tubetrack::player_settings_from_environment();
    if (const auto script = read_script(settings); !script) return refuse(script.error().message);
    const auto opened = open(*settings);
    if (!opened) return refuse(opened.error().message);
    return new VirtualDevice(*settings, opened->source->info(), *bench_);
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }
  void shutdown() override { bench_.reset(); }

 private:
  oni::driver::DeviceBase* refuse(const std::string& why) {
    getServices().errorLoggerAppend("%s", why.c_str());
    return nullptr;
  }

  static tubetrack::Expected<std::vector<tubetrack::Fault>> read_script(
      const tubetrack::Expected<tubetrack::PlayerSettings>& settings) {
    if (!settings) return tl::make_unexpected(settings.error());
    if (settings->fault_script.empty()) return std::vector<tubetrack::Fault>();
    return tubetrack::read_fault_script(settings->fault_script);
  }

  static tubetrack::Expected<tubetrack::OpenedRecording> open(const tubetrack::PlayerSettings& settings) {
    if (settings.recording.extension() == ".oni") {
      return tl::make_unexpected(tubetrack::Error::usage(
          "TUBETRACK_VIRTUAL_DEVICE: the runtime plays .oni itself, a driver in it can't: open the file by its path"));
    }
    return tubetrack::open_recording(settings.recording, settings.options);
  }

  OniDeviceInfo device_{};
  std::unique_ptr<Bench> bench_;
};

}  // namespace

ONI_EXPORT_DRIVER(VirtualDriver)
