// What an OpenNI2 stream is set to, and what its frames look like then: shared by devices and .oni files.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>

#include "openni2_runtime.hpp"

namespace tubetrack {

namespace {

bool fits(const openni::VideoMode& mode, const OpenNi2Options& want) {
  const double unit = metres_per_unit_of(mode.getPixelFormat());
  return unit > 0.0 && (want.width == 0 || mode.getResolutionX() == want.width) &&
         (want.height == 0 || mode.getResolutionY() == want.height) && (want.fps == 0 || mode.getFps() == want.fps) &&
         (want.metres_per_unit == 0.0 || std::abs(unit - want.metres_per_unit) < 1e-9);
}

Expected<void> set_cropping(openni::VideoStream& stream, const OpenNi2Options& options, StreamInfo& info,
                            bool mirrored) {
  if (!options.crop_px) {
    // What a program before us left set would be a silent change of the camera.
    if (stream.isCroppingSupported()) stream.resetCropping();
    return {};
  }
  const auto [u, v, width, height] = *options.crop_px;
  Intrinsics& in = info.intrinsics;
  if (u < 0 || v < 0 || width < 1 || height < 1 || width > in.width - u || height > in.height - v) {
    return tl::make_unexpected(Error::usage(fmt::format("{}: crop {},{},{},{}: takes u,v,w,h within {}x{} pixels",
                                                        info.name, u, v, width, height, in.width, in.height)));
  }
  // The device crops what it sends, so a mirrored image from its other side.
  const int left = mirrored ? in.width - u - width : u;
  if (!stream.isCroppingSupported() || stream.setCropping(left, v, width, height) != openni::STATUS_OK) {
    return openni2_failed(
        fmt::format("{}: the device can't crop to {},{},{},{}; use --roi u,v,w,h", info.name, u, v, width, height));
  }
  in.width = width;
  in.height = height;
  return {};
}

}  // namespace

double metres_per_unit_of(openni::PixelFormat format) {
  if (format == openni::PIXEL_FORMAT_DEPTH_1_MM) return 0.001;
  if (format == openni::PIXEL_FORMAT_DEPTH_100_UM) return 0.0001;
  return 0.0;
}

std::string describe(const openni::VideoMode& mode) {
  return fmt::format("{}x{}@{} {}", mode.getResolutionX(), mode.getResolutionY(), mode.getFps(),
                     metres_per_unit_of(mode.getPixelFormat()) == 0.001 ? "1 mm" : "100 um");
}

Expected<openni::VideoMode> choose_openni2_mode(const std::string& name, const openni::VideoStream& stream,
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
    if (metres_per_unit_of(offered[i].getPixelFormat()) == 0.0) continue;
    list += (list.empty() ? "" : ", ") + describe(offered[i]);
    if (fits(offered[i], want) && (best == nullptr || preference(offered[i]) > preference(*best))) best = &offered[i];
  }
  if (best == nullptr) {
    return openni2_failed(fmt::format("{}: no depth mode like {}x{}@{} unit {:g} m (0: any); the device offers {}",
                                      name, want.width, want.height, want.fps, want.metres_per_unit,
                                      list.empty() ? "none" : list));
  }
  return *best;
}

Expected<void> set_up_openni2_stream(openni::VideoStream& stream, const OpenNi2Options& options, StreamInfo& info,
                                     bool& mirrored) {
  const auto mode = choose_openni2_mode(info.name, stream, options);
  if (!mode) return tl::make_unexpected(mode.error());
  if (stream.setVideoMode(*mode) != openni::STATUS_OK) {
    return openni2_failed(
        fmt::format("{}: the device refused its own mode {}: {}", info.name, describe(*mode), openni2_says()));
  }
  info.metres_per_unit = metres_per_unit_of(mode->getPixelFormat());
  info.intrinsics.width = mode->getResolutionX();
  info.intrinsics.height = mode->getResolutionY();
  // The default is each driver's own (PrimeSense's is on), and a mirrored scene has its bends the wrong way round.
  stream.setMirroringEnabled(false);
  mirrored = stream.getMirroringEnabled();
  return set_cropping(stream, options, info, mirrored);
}

Expected<Intrinsics> openni2_intrinsics(const openni::VideoStream& stream, const OpenNi2Options& options,
                                        const std::string& name) {
  const openni::VideoMode mode = stream.getVideoMode();
  Intrinsics in;
  in.width = mode.getResolutionX();
  in.height = mode.getResolutionY();
  const auto given = given_intrinsics(name, in.width, in.height, options.calibration, options.intrinsics_px);
  if (!given) return tl::make_unexpected(given.error());
  if (*given) {
    in = **given;
  } else {
    const double horizontal_rad = static_cast<double>(stream.getHorizontalFieldOfView());
    const double vertical_rad = static_cast<double>(stream.getVerticalFieldOfView());
    in = intrinsics_from_field_of_view(in.width, in.height, horizontal_rad, vertical_rad);
    // An angle said as a float holds f to some 1e-4 px. Rounded to 1e-3 px, what was a round number is one again: so a
    // recording played by the virtual device gives the very bytes that it gives when read from disk.
    in.fx_px = std::round(in.fx_px * 1e3) / 1e3;
    in.fy_px = std::round(in.fy_px * 1e3) / 1e3;
  }
  if (options.crop_px) {
    in.cx_px -= (*options.crop_px)[0];
    in.cy_px -= (*options.crop_px)[1];
    in.width = (*options.crop_px)[2];
    in.height = (*options.crop_px)[3];
  }
  if (const auto valid = validate(in); !valid) {
    return openni2_failed(fmt::format("{}: {}; the device's field of view can't be used, give --intrinsics fx,fy,cx,cy",
                                      name, valid.error().message));
  }
  return in;
}

std::string openni2_frame_problem(const openni::VideoFrameRef& frame, const Intrinsics& size) {
  const auto row_bytes = static_cast<std::size_t>(size.width) * sizeof(std::uint16_t);
  const auto stride = static_cast<std::size_t>(std::max(frame.getStrideInBytes(), 0));
  const auto bytes = static_cast<std::size_t>(std::max(frame.getDataSize(), 0));
  if (frame.getWidth() == size.width && frame.getHeight() == size.height && stride >= row_bytes &&
      bytes >= stride * (static_cast<std::size_t>(size.height) - 1) + row_bytes) {
    return {};
  }
  return fmt::format("{}x{} in {} bytes instead of {}x{}", frame.getWidth(), frame.getHeight(), frame.getDataSize(),
                     size.width, size.height);
}

void copy_openni2_pixels(const openni::VideoFrameRef& from, const Intrinsics& size, bool mirrored, std::uint16_t* to) {
  const auto* bytes = static_cast<const std::byte*>(from.getData());
  const auto width = static_cast<std::size_t>(size.width);
  for (int v = 0; v < size.height; ++v, to += width) {
    const std::byte* row = bytes + static_cast<std::size_t>(v) * static_cast<std::size_t>(from.getStrideInBytes());
    std::memcpy(to, row, width * sizeof(std::uint16_t));
    if (mirrored) std::reverse(to, to + width);
  }
}

}  // namespace tubetrack
