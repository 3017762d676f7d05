// What a camera is and what it is set to.
#include "libcamera_setup.hpp"

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace tubetrack {

namespace {

/// A format that can carry depth; the first in the list that a camera has is taken.
struct DepthFormat {
  const char* name;
  MonoPacking packing;
};
constexpr DepthFormat kFormats[] = {{"R16", MonoPacking::words},     {"SBGGR16", MonoPacking::words},
                                    {"SGBRG16", MonoPacking::words}, {"SGRBG16", MonoPacking::words},
                                    {"SRGGB16", MonoPacking::words}, {"R12", MonoPacking::words},
                                    {"R10", MonoPacking::words},     {"R10_CSI2P", MonoPacking::csi2_ten_bits},
                                    {"YUYV", MonoPacking::words},    {"R8", MonoPacking::bytes}};

std::string nothing_listed() {
  return fmt::format(
      "libcamera {} lists no camera; plugged in, and may this user read /dev/video*? A camera that sends only Y16 or "
      "Z16 is not listed by this version: libcamera 0.3.0 and later take those (as R16)",
      libcamera::CameraManager::version());
}

Expected<const DepthFormat*> choose_format(const libcamera::StreamConfiguration& stream, const std::string& wanted,
                                           const std::string& name) {
  const auto offered = stream.formats().pixelformats();
  std::string list;
  for (const auto& format : offered) list += (list.empty() ? "" : ", ") + format.toString();
  const DepthFormat* format = nullptr;
  for (const DepthFormat& known : kFormats) {
    const auto same = [&](const auto& one) { return one.toString() == known.name; };
    const bool asked = wanted.empty() || wanted == known.name;
    if (format == nullptr && asked && std::any_of(offered.begin(), offered.end(), same)) format = &known;
  }
  if (format == nullptr) {
    return failed(fmt::format(
        "{}: sends {}{}; depth can come as R8, R10, R12, SBGGR16 (and its like) or YUYV with libcamera {}, and as R16 "
        "from 0.3.0 on",
        name, list.empty() ? "nothing that libcamera knows" : list, wanted.empty() ? "" : ", not " + wanted,
        libcamera::CameraManager::version()));
  }
  return format;
}

libcamera::Size choose_size(const std::vector<libcamera::Size>& sizes, const LibcameraOptions& options) {
  const libcamera::Size usual(640, 480);
  if (options.width != 0) return {static_cast<unsigned>(options.width), static_cast<unsigned>(options.height)};
  const bool has_usual = sizes.empty() || std::find(sizes.begin(), sizes.end(), usual) != sizes.end();
  return has_usual ? usual : sizes.front();
}

}  // namespace

Expected<std::unique_ptr<LibcameraManager>> LibcameraManager::start() {
  std::unique_lock turn(one_at_a_time(), std::try_to_lock);
  if (!turn) return failed("libcamera: this program has a camera open already; libcamera takes one manager a process");
  // Its chatter would stand between our lines; what matters is in our own errors.
  if (std::getenv("LIBCAMERA_LOG_LEVELS") == nullptr) libcamera::logSetTarget(libcamera::LoggingTargetNone);
  std::unique_ptr<LibcameraManager> manager(new LibcameraManager(std::move(turn)));
  if (const int code = manager->manager_.start(); code != 0) {
    return failed(
        fmt::format("libcamera: does not start (error {}); may this user read /dev/media* and /dev/video*?", -code));
  }
  return manager;
}

std::string libcamera_model(const libcamera::Camera& camera) {
  const auto model = camera.properties().get(libcamera::properties::Model);
  return model ? std::string(*model) : std::string();
}

Expected<std::shared_ptr<libcamera::Camera>> choose_libcamera(libcamera::CameraManager& manager,
                                                              const std::string& id) {
  const auto cameras = manager.cameras();
  if (cameras.empty()) return failed(nothing_listed());
  const auto chosen = std::find_if(cameras.begin(), cameras.end(),
                                   [&](const auto& camera) { return id.empty() || camera->id() == id; });
  if (chosen == cameras.end()) {
    return failed(fmt::format("libcamera:{}: no such camera; `tubetrack devices` lists those that are there", id));
  }
  return *chosen;
}

Expected<std::unique_ptr<libcamera::CameraConfiguration>> configure_libcamera(libcamera::Camera& camera,
                                                                              const LibcameraOptions& options,
                                                                              StreamInfo& info, MonoPacking& packing) {
  auto configuration = camera.generateConfiguration({libcamera::StreamRole::VideoRecording});
  if (!configuration || configuration->empty()) return failed(fmt::format("{}: has no stream", info.name));
  libcamera::StreamConfiguration& stream = configuration->at(0);
  const auto format = choose_format(stream, options.format, info.name);
  if (!format) return tl::make_unexpected(format.error());
  packing = (*format)->packing;
  stream.pixelFormat = libcamera::PixelFormat::fromString((*format)->name);
  const auto sizes = stream.formats().sizes(stream.pixelFormat);
  const libcamera::Size size = choose_size(sizes, options);
  const libcamera::PixelFormat wanted = stream.pixelFormat;
  stream.size = size;
  if (configuration->validate() == libcamera::CameraConfiguration::Invalid || stream.pixelFormat != wanted ||
      (options.width != 0 && stream.size != size)) {
    std::string known;
    for (const auto& one : sizes) known += (known.empty() ? "" : ", ") + one.toString();
    return failed(fmt::format("{}: does not send {} at {}; its sizes are {}", info.name, (*format)->name,
                              size.toString(), known));
  }
  if (camera.configure(configuration.get()) != 0) {
    return failed(fmt::format("{}: refuses the configuration {}", info.name, stream.toString()));
  }
  info.metres_per_unit = options.metres_per_unit;
  info.intrinsics.width = static_cast<int>(stream.size.width);
  info.intrinsics.height = static_cast<int>(stream.size.height);
  const std::size_t row = mono_row_bytes(packing, info.intrinsics.width);
  if (row == 0 || stream.stride < row) {
    return failed(fmt::format("{}: {}: rows of {} bytes, takes {} and a multiple of 4 pixels where packed", info.name,
                              stream.toString(), stream.stride, row));
  }
  return configuration;
}

Expected<Intrinsics> libcamera_intrinsics(const LibcameraOptions& options, const StreamInfo& info) {
  const Intrinsics& sent = info.intrinsics;
  const auto given = given_intrinsics(info.name, sent.width, sent.height, options.calibration, options.intrinsics_px);
  if (!given) return tl::make_unexpected(given.error());
  if (!*given) {
    return tl::make_unexpected(Error::usage(fmt::format(
        "{}: libcamera does not say the camera's geometry; give --intrinsics fx,fy,cx,cy or a camera_info.yaml",
        info.name)));
  }
  if (const auto valid = validate(**given); !valid) {
    return tl::make_unexpected(Error::usage(fmt::format("{}: {}", info.name, valid.error().message)));
  }
  return **given;
}

Expected<std::vector<DeviceDescription>> list_libcamera_devices() {
  const auto manager = LibcameraManager::start();
  if (!manager) return tl::make_unexpected(manager.error());
  std::vector<DeviceDescription> devices;
  for (const auto& camera : (***manager).cameras()) {
    devices.push_back({"libcamera:" + camera->id(), "libcamera", libcamera_model(*camera)});
  }
  return devices;
}

}  // namespace tubetrack
