#include "device.hpp"

#include <fmt/format.h>

#include <optional>
#include <system_error>
#include <utility>

#include "flag_values.hpp"
#include "tubetrack/replay/camera_info.hpp"
#include "tubetrack/sensors/reconnect.hpp"

#ifdef TUBETRACK_HAS_LIBCAMERA
#include "tubetrack/sensors/libcamera_source.hpp"
#endif
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
  std::string take_note() override { return source_->take_note(); }
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

/// What the flags ask for, read once for all back-ends. Zero and empty: not asked.
struct DeviceRequest {
  FrameRange frames;
  std::optional<std::array<double, 4>> intrinsics_px;
  std::optional<Intrinsics> calibration;
  std::optional<double> metres_per_unit;
  std::string mode_unit;  ///< 1mm or 100um
  int width = 0;
  int height = 0;
  int fps = 0;
  std::optional<std::array<int, 4>> crop_px;
  ReconnectOptions reconnect;
};

Expected<void> read_mode(const std::string& text, DeviceRequest& request) {
  constexpr std::string_view kForm = "WIDTHxHEIGHT, then @FPS and :1mm or :100um where wanted, like 640x480@30:1mm";
  if (text.empty()) return {};
  std::string rest = text;
  if (const auto colon = rest.find(':'); colon != std::string::npos) {
    request.mode_unit = rest.substr(colon + 1);
    if (request.mode_unit != "1mm" && request.mode_unit != "100um") return malformed("--mode", text, kForm);
    rest.resize(colon);
  }
  if (const auto at = rest.find('@'); at != std::string::npos) {
    const auto fps = number_from<int>(std::string_view(rest).substr(at + 1));
    if (!fps || *fps < 1) return malformed("--mode", text, kForm);
    request.fps = *fps;
    rest.resize(at);
  }
  const auto size = numbers_from<int, 2>(rest, 'x');
  if (!size || (*size)[0] < 1 || (*size)[1] < 1) return malformed("--mode", text, kForm);
  request.width = (*size)[0];
  request.height = (*size)[1];
  return {};
}

/// `--intrinsics` is four numbers, or a file that a calibration left.
Expected<void> read_intrinsics(RecordingFlags& reading, DeviceRequest& request) {
  std::error_code ignored;
  if (reading.intrinsics.empty() || !std::filesystem::is_regular_file(reading.intrinsics, ignored)) return {};
  auto read = read_camera_info(reading.intrinsics);
  if (!read) return tl::make_unexpected(Error::usage("--intrinsics " + read.error().message));
  request.calibration = read->intrinsics;
  reading.intrinsics.clear();
  return {};
}

Expected<DeviceRequest> read_request(const DeviceFlags& flags) {
  DeviceRequest request;
  RecordingFlags reading = flags.reading;
  if (auto read = read_intrinsics(reading, request); !read) return tl::make_unexpected(read.error());
  const auto options = recording_options_from(reading);
  if (!options) return tl::make_unexpected(options.error());
  request.frames = options->frames;
  request.intrinsics_px = options->intrinsics_px;
  request.metres_per_unit = options->metres_per_unit;
  if (auto read = read_mode(flags.mode, request); !read) return tl::make_unexpected(read.error());
  if (!flags.crop.empty()) {
    request.crop_px = numbers_from<int, 4>(flags.crop, ',');
    if (!request.crop_px) return malformed("--crop", flags.crop, "u,v,w,h in pixels, like 100,50,320,240");
  }
  if (!flags.silence.empty()) {
    const auto silence_s = number_from<double>(flags.silence);
    if (!silence_s || *silence_s < 0.0 || *silence_s > 86400.0) {
      return malformed("--silence", flags.silence, "seconds, 0 for never");
    }
    request.reconnect.silence = std::chrono::milliseconds(static_cast<std::int64_t>(*silence_s * 1e3));
  }
  if (flags.on_reconnect != "reset" && flags.on_reconnect != "keep" && flags.on_reconnect != "stop") {
    return malformed("--on-reconnect", flags.on_reconnect, "reset, keep or stop");
  }
  return request;
}

#ifdef TUBETRACK_HAS_OPENNI2
Expected<std::unique_ptr<FrameSource>> open_openni2_device(const std::string& uri, const DeviceRequest& request,
                                                           const DeviceFlags& flags) {
  if (request.metres_per_unit) {
    return tl::make_unexpected(Error::usage("--depth-scale: a device says its own unit; leave it out"));
  }
  OpenNi2Options options;
  options.width = request.width;
  options.height = request.height;
  options.fps = request.fps;
  if (!request.mode_unit.empty()) options.metres_per_unit = request.mode_unit == "1mm" ? 0.001 : 0.0001;
  options.intrinsics_px = request.intrinsics_px;
  options.calibration = request.calibration;
  options.crop_px = request.crop_px;
  options.record_oni = flags.record_oni;
  if (flags.reconnects()) return open_openni2_reconnecting(uri, options, request.reconnect);
  return open_openni2(uri, options);
}
#endif

#ifdef TUBETRACK_HAS_LIBCAMERA
Expected<std::unique_ptr<FrameSource>> open_libcamera_device(const std::string& id, const DeviceRequest& request,
                                                             const DeviceFlags& flags) {
  const auto refuse = [](const char* text) { return tl::make_unexpected(Error::usage(text)); };
  if (request.crop_px) return refuse("--crop: libcamera cameras send whole images; use --roi u,v,w,h");
  if (!request.mode_unit.empty())
    return refuse("--mode: a libcamera camera has no unit of its own; give --depth-scale");
  if (request.fps != 0)
    return refuse("--mode: the frames a second of a libcamera camera can't be chosen; leave @FPS out");
  if (!flags.record_oni.empty()) return refuse(".oni is for OpenNI2 devices; record to a folder");
  LibcameraOptions options;
  options.width = request.width;
  options.height = request.height;
  options.metres_per_unit = request.metres_per_unit.value_or(0.0);
  options.intrinsics_px = request.intrinsics_px;
  options.calibration = request.calibration;
  if (flags.reconnects()) return open_libcamera_reconnecting(id, options, request.reconnect);
  return open_libcamera(id, options);
}
#endif

/// The back-end that the device's name belongs to.
Expected<std::unique_ptr<FrameSource>> open_source(const std::string& uri,
                                                   [[maybe_unused]] const DeviceRequest& request,
                                                   [[maybe_unused]] const DeviceFlags& flags) {
  constexpr std::string_view kLibcamera = "libcamera";
  if (uri == kLibcamera || uri.starts_with("libcamera:")) {
#ifdef TUBETRACK_HAS_LIBCAMERA
    return open_libcamera_device(uri == kLibcamera ? "" : uri.substr(kLibcamera.size() + 1), request, flags);
#else
    return tl::make_unexpected(
        Error::failed("this tubetrack was built without libcamera; install libcamera-dev and build again"));
#endif
  }
#ifdef TUBETRACK_HAS_OPENNI2
  return open_openni2_device(uri, request, flags);
#else
  return tl::make_unexpected(without_openni2());
#endif
}

}  // namespace

Error without_openni2() {
  return Error::failed(
      "this tubetrack was built without OpenNI2; install libopenni2-dev (to run only: libopenni2-0) and build again");
}

void add_device_flags(CLI::App& command, DeviceFlags& flags) {
  add_recording_flags(command, flags.reading);
  command.add_option("--mode", flags.mode, "what the device is to send, where it has a choice")
      ->type_name("WxH[@FPS][:1mm|:100um]");
  command.add_option("--crop", flags.crop, "only this part of the image is sent; the camera is that of the part")
      ->type_name("u,v,w,h");
  command
      .add_option("--silence", flags.silence,
                  "without a frame for so long the device counts as lost and is opened again (default 5; 0: never)")
      ->type_name("SECONDS");
}

Expected<std::unique_ptr<FrameSource>> open_device(const std::string& uri, const DeviceFlags& flags) {
  const auto request = read_request(flags);
  if (!request) return tl::make_unexpected(request.error());
  auto source = open_source(uri, *request, flags);
  if (!source) return source;
  return std::make_unique<FramesOf>(std::move(*source), request->frames);
}

std::string device_note(const StreamInfo& info, const DeviceFlags& flags) {
  const Intrinsics& in = info.intrinsics;
  std::string from = "the device's field of view";
  if (!flags.reading.intrinsics.empty()) {
    std::error_code ignored;
    const bool file = std::filesystem::is_regular_file(flags.reading.intrinsics, ignored);
    from = file ? flags.reading.intrinsics : "--intrinsics";
  }
  return fmt::format("{}: {}x{}, unit {:g} m, fx {:.2f}, fy {:.2f}, cx {:.2f}, cy {:.2f} px from {}", info.name,
                     in.width, in.height, info.metres_per_unit, in.fx_px, in.fy_px, in.cx_px, in.cy_px, from);
}

}  // namespace tubetrack
