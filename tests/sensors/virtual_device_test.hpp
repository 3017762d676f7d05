#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "tubetrack/replay/recorder.hpp"
#include "tubetrack/sensors/openni2_source.hpp"

namespace tubetrack::test {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr milliseconds kLong{60000};  // longer than any machine needs: never the measure of a test

struct Image {
  std::vector<std::uint16_t> pixels;
  double timestamp_s = 0.0;
};

/// The real OpenNI2 runtime with the virtual device (docs/live.md), which plays a recording of noise in lockstep.
class VirtualDeviceTest : public testing::Test {
 protected:
  VirtualDeviceTest() {
    fs::create_directories(folder_);
    set("TUBETRACK_VIRTUAL_AT_END", "stall");
    set("TUBETRACK_VIRTUAL_LOCKSTEP", lockstep_);
    std::ofstream(lockstep_).flush();
  }
  ~VirtualDeviceTest() override {
    for (const std::string& name : set_) unsetenv(name.c_str());
    fs::remove_all(folder_);
  }

  void set(const std::string& name, const fs::path& value) {
    setenv(name.c_str(), value.c_str(), 1);
    set_.push_back(name);
  }

  /// Writes a recording of noise over all 16 bits and makes it the device.
  void plug_in(int frames, double metres_per_unit = 0.001, Intrinsics in = {40, 30, 35.5, 36.5, 19.5, 14.5, {}}) {
    in_ = in;
    StreamInfo info;
    info.intrinsics = in;
    info.metres_per_unit = metres_per_unit;
    auto recorder = Recorder::create(folder_ / "recording", info);
    ASSERT_TRUE(recorder) << recorder.error().message;
    std::mt19937 random(7);
    std::uniform_int_distribution<int> any(0, 65535);
    images_.clear();
    for (int i = 0; i < frames; ++i) {
      Image image;
      // Unix time with microseconds and an uneven pace: what a double and the device's integer must both hold.
      image.timestamp_s = 1305031102.160407 + 0.033123 * i + (i % 3) * 0.000457;
      image.timestamp_s = static_cast<double>(std::llround(image.timestamp_s * 1e6)) / 1e6;
      image.pixels.resize(static_cast<std::size_t>(in.width * in.height));
      // Three of four values from 0.5 to 1.5 m, so that the median is that of a scene.
      const int near = static_cast<int>(std::lround(0.5 / metres_per_unit));
      for (std::size_t k = 0; k < image.pixels.size(); ++k) {
        image.pixels[k] = static_cast<std::uint16_t>(k % 4 != 0 ? near + any(random) % (2 * near) : any(random));
      }
      image.pixels.front() = 65535;
      image.pixels.back() = 0;
      DepthFrame frame;
      frame.pixels = image.pixels.data();
      frame.width = in.width;
      frame.height = in.height;
      frame.stride_bytes = static_cast<std::size_t>(in.width) * 2;
      frame.metres_per_unit = metres_per_unit;
      frame.timestamp_s = image.timestamp_s;
      ASSERT_TRUE(recorder->write(frame));
      images_.push_back(std::move(image));
    }
    set("TUBETRACK_VIRTUAL_DEVICE", folder_ / "recording");
  }

  std::unique_ptr<FrameSource> open(const OpenNi2Options& options = {}) {
    auto source = open_openni2("", options);
    EXPECT_TRUE(source) << (source ? "" : source.error().message);
    return source ? std::move(*source) : nullptr;
  }

  /// Frames come at their own time, over and over; `speed` times as fast as recorded.
  void play_on_its_own(const std::string& speed = "1") {
    unsetenv("TUBETRACK_VIRTUAL_LOCKSTEP");
    set("TUBETRACK_VIRTUAL_AT_END", "repeat");
    set("TUBETRACK_VIRTUAL_SPEED", speed);
  }

  /// Beside the recording, where the device looks for it.
  void script(const std::string& text) { std::ofstream(folder_ / "recording.faults") << text; }

  /// The device sends the next frame only after this.
  void allow_next() { std::ofstream(lockstep_, std::ios::app) << "\n"; }

  static std::vector<std::uint16_t> pixels_of(const DepthFrame& frame) {
    std::vector<std::uint16_t> pixels;
    for (int v = 0; v < frame.height; ++v) pixels.insert(pixels.end(), frame.row(v), frame.row(v) + frame.width);
    return pixels;
  }

  fs::path folder_ = fs::path(testing::TempDir()) / ("virtual_device_" + std::to_string(getpid()));
  fs::path lockstep_ = folder_ / "taken";
  Intrinsics in_;
  std::vector<Image> images_;
  std::vector<std::string> set_;
};

}  // namespace tubetrack::test
