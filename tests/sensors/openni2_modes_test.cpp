// What an OpenNI2 device can be set to, against the real runtime with the virtual device: modes, units, mirroring,
// cropping, where intrinsics come from; and .oni files.
#include <dlfcn.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "sensors/virtual_device_test.hpp"

namespace tubetrack {
namespace {

using test::kLong;
using testing::HasSubstr;

class OpenNi2Modes : public test::VirtualDeviceTest {
 protected:
  /// The first frame of the recording as the device should send it: every `step`th pixel of the part.
  std::vector<std::uint16_t> part_of_first(const std::array<int, 4>& crop_px, int step = 1) const {
    std::vector<std::uint16_t> pixels;
    for (int v = crop_px[1]; v < crop_px[1] + crop_px[3]; ++v) {
      for (int u = crop_px[0]; u < crop_px[0] + crop_px[2]; ++u) {
        pixels.push_back(images_[0].pixels[static_cast<std::size_t>(v * step * in_.width + u * step)]);
      }
    }
    return pixels;
  }

  std::vector<std::uint16_t> first_frame(const OpenNi2Options& options, StreamInfo& info) {
    std::ofstream(lockstep_).flush();
    const auto source = open(options);
    DepthFrame frame;
    if (!source || source->next(frame, kLong) != FrameOutcome::ok) return {};
    info = source->info();
    EXPECT_EQ(frame.width, info.intrinsics.width);
    EXPECT_EQ(frame.height, info.intrinsics.height);
    return pixels_of(frame);
  }
};

TEST_F(OpenNi2Modes, EveryModeThatIsOfferedIsDeliveredBitForBit) {
  for (const double unit : {0.001, 0.0001}) {
    plug_in(1, unit);
    for (const int step : {1, 2}) {
      OpenNi2Options options;
      options.width = 40 / step;
      options.height = 30 / step;
      options.fps = 30;
      options.metres_per_unit = unit;
      StreamInfo info;
      EXPECT_EQ(first_frame(options, info), part_of_first({0, 0, 40 / step, 30 / step}, step));
      EXPECT_EQ(info.metres_per_unit, unit);
      EXPECT_EQ(info.intrinsics.width, 40 / step);
      EXPECT_NEAR(info.intrinsics.fx_px, in_.fx_px / step, 1e-3);
      EXPECT_NEAR(info.intrinsics.fy_px, in_.fy_px / step, 1e-3);
    }
  }
}

TEST_F(OpenNi2Modes, ACroppedImageIsThatPartAndTheCameraIsShifted) {
  plug_in(1);
  for (const char* mirror : {"on", "always"}) {
    set("TUBETRACK_VIRTUAL_MIRROR", mirror);
    OpenNi2Options options;
    options.crop_px = {6, 3, 20, 11};
    StreamInfo info;
    EXPECT_EQ(first_frame(options, info), part_of_first(*options.crop_px)) << mirror;
    EXPECT_EQ(info.intrinsics.width, 20);
    EXPECT_EQ(info.intrinsics.height, 11);
    EXPECT_EQ(info.intrinsics.cx_px, 19.5 - 6);
    EXPECT_EQ(info.intrinsics.cy_px, 14.5 - 3);
    EXPECT_EQ(info.intrinsics.fx_px, in_.fx_px);
  }
}

TEST_F(OpenNi2Modes, ADeviceThatMirrorsWhateverItIsToldIsFlippedBack) {
  plug_in(1);
  set("TUBETRACK_VIRTUAL_MIRROR", "always");
  StreamInfo info;
  EXPECT_EQ(first_frame({}, info), images_[0].pixels);
}

TEST_F(OpenNi2Modes, ACropBeyondTheImageIsRefusedWithItsNumbers) {
  plug_in(1);
  OpenNi2Options options;
  options.crop_px = {30, 0, 11, 5};
  const auto source = open_openni2("", options);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().kind, Error::Kind::usage);
  EXPECT_EQ(source.error().message, "virtual:0: crop 30,0,11,5: takes u,v,w,h within 40x30 pixels");
}

TEST_F(OpenNi2Modes, ACalibrationIsUsedWholeAndOneOfAnotherSizeIsRefused) {
  plug_in(1);
  OpenNi2Options options;
  options.calibration = Intrinsics{40, 30, 33.25, 34.5, 18.0, 15.0, {0.1, -0.2, 0.001, 0.002, 0.05, 0, 0, 0}};
  options.intrinsics_px = {1.0, 2.0, 3.0, 4.0};
  StreamInfo info;
  first_frame(options, info);
  EXPECT_EQ(info.intrinsics.fx_px, 33.25);
  EXPECT_EQ(info.intrinsics.cy_px, 15.0);
  EXPECT_EQ(info.intrinsics.distortion, options.calibration->distortion);
  options.calibration->width = 80;
  const auto source = open_openni2("", options);
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error().message, HasSubstr("the calibration is for 80x30 pixels and the device sends 40x30"));
}

class OniFile : public OpenNi2Modes {
 public:
  /// The runtime's driver is kept loaded to the end, so that what its player loses is reported with its name
  /// (lsan.supp).
  static void SetUpTestSuite() {
    const char* path = std::getenv("LD_LIBRARY_PATH");
    const std::string folders = path ? path : "";
    dlopen((folders.substr(0, folders.find(':')) + "/OpenNI2/Drivers/libOniFile.so.0").c_str(),
           RTLD_NOW | RTLD_NODELETE);
  }

 protected:
  /// What the codec keeps exactly: few different values, and the last pixels alike.
  void make_recordable() {
    const int frames = 12;
    for (test::Image& image : images_) {
      for (std::uint16_t& value : image.pixels) value = static_cast<std::uint16_t>(500 + value % 3000);
      std::fill(image.pixels.end() - 40, image.pixels.end(), std::uint16_t{0});
    }
    StreamInfo info;
    info.intrinsics = in_;
    info.metres_per_unit = 0.001;
    auto recorder = Recorder::create(folder_ / "recording", info);
    ASSERT_TRUE(recorder);
    for (int i = 0; i < frames; ++i) {
      DepthFrame frame;
      frame.pixels = images_[static_cast<std::size_t>(i)].pixels.data();
      frame.width = in_.width;
      frame.height = in_.height;
      frame.stride_bytes = static_cast<std::size_t>(in_.width) * 2;
      frame.timestamp_s = images_[static_cast<std::size_t>(i)].timestamp_s;
      ASSERT_TRUE(recorder->write(frame));
    }
  }

  /// The process that decodes for this one; 0 where there is none.
  static pid_t reader_process() {
    for (const auto& entry : test::fs::directory_iterator("/proc")) {
      std::ifstream in(entry.path() / "stat");
      std::string pid;
      std::string name;
      std::string state;
      pid_t parent = 0;
      if (in >> pid >> name >> state >> parent && parent == getpid() && name.starts_with("(tubetrack_oni_")) {
        return static_cast<pid_t>(std::stoi(pid));
      }
    }
    return 0;
  }

  /// Twelve frames.
  test::fs::path record(const Intrinsics& in = {40, 30, 35.5, 36.5, 19.5, 14.5, {}}) {
    plug_in(12, 0.001, in);
    make_recordable();
    OpenNi2Options options;
    options.record_oni = folder_ / "desk.oni";
    const auto source = open(options);
    DepthFrame frame;
    for (std::size_t i = 0; source && i < images_.size(); ++i) {
      EXPECT_EQ(source->next(frame, kLong), FrameOutcome::ok);
      allow_next();
    }
    return options.record_oni;
  }
};

TEST_F(OniFile, ARecordedStreamIsReadBackBitForBitWithItsCameraAndTimes) {
  const auto path = record();
  const auto file = open_oni_file(path, {});
  ASSERT_TRUE(file) << file.error().message;
  const StreamInfo& info = (*file)->info();
  ASSERT_EQ(info.frame_count, 12);
  EXPECT_EQ(info.metres_per_unit, 0.001);
  EXPECT_EQ(info.intrinsics.width, 40);
  EXPECT_NEAR(info.intrinsics.fx_px, in_.fx_px, 1e-3);
  DepthFrame frame;
  for (std::size_t i = 0; i < images_.size(); ++i) {
    ASSERT_EQ((*file)->next(frame, kLong), FrameOutcome::ok) << (*file)->last_problem();
    EXPECT_EQ(frame.index, static_cast<std::int64_t>(i));
    EXPECT_NEAR(frame.timestamp_s, images_[i].timestamp_s - images_[0].timestamp_s, 2e-6);
    EXPECT_EQ(pixels_of(frame), images_[i].pixels) << i;
  }
  EXPECT_EQ((*file)->next(frame, kLong), FrameOutcome::end_of_stream);
}

TEST_F(OniFile, WhatIsCutEmptyOrSomethingElseIsRefusedInOneLine) {
  const auto path = record();
  std::ifstream in(path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  const auto broken = folder_ / "broken.oni";
  // The recorder fills a file up with zeros, so half of one may be whole.
  const std::size_t size = whole.find_last_not_of('\0');
  for (const std::string& bytes : {whole.substr(0, size / 2), whole.substr(0, size - 4), whole.substr(0, 100),
                                   std::string(), std::string("no recording at all"), std::string(4096, '\7')}) {
    std::ofstream(broken, std::ios::binary | std::ios::trunc) << bytes;
    const auto file = open_oni_file(broken, {});
    ASSERT_FALSE(file) << bytes.size() << " of " << whole.size() << " bytes";
    EXPECT_THAT(file.error().message, HasSubstr("broken.oni: can't be read as .oni: "));
    EXPECT_EQ(file.error().message.find('\n'), std::string::npos);
  }
}

TEST_F(OniFile, WhenItsReaderCrashesTheStreamEndsWithOneClearLine) {
  const auto path = record({160, 120, 150.0, 150.0, 79.5, 59.5, {}});  // more than the socket between the two holds
  const auto file = open_oni_file(path, {});
  ASSERT_TRUE(file) << file.error().message;
  DepthFrame frame;
  ASSERT_EQ((*file)->next(frame, kLong), FrameOutcome::ok);
  const pid_t reader = reader_process();
  ASSERT_GT(reader, 0);
  kill(reader, SIGSEGV);
  FrameOutcome outcome = FrameOutcome::ok;
  std::int64_t good = 1;
  while ((outcome = (*file)->next(frame, kLong)) == FrameOutcome::ok) ++good;
  ASSERT_EQ(outcome, FrameOutcome::device_lost);
  EXPECT_EQ((*file)->last_problem(),
            fmt::format("the OpenNI2 runtime crashed reading it after {} frame(s); the file is "
                        "damaged",
                        good));
}

TEST_F(OniFile, FlippedBytesNeverTakeTheProgramDownNorHangIt) {
  const auto path = record();
  std::ifstream in(path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  const std::size_t size = whole.find_last_not_of('\0');
  const auto broken = folder_ / "broken.oni";
  std::mt19937 random(11);
  std::map<std::string, int> ends;
  for (int round = 0; round < 16; ++round) {
    std::string bytes = whole;
    // Most crashes come of the records before the first frame.
    const std::size_t last = round % 2 == 0 ? 1000 : size;
    for (int flips = 1 << round % 5; flips > 0; --flips) {
      bytes[std::uniform_int_distribution<std::size_t>(24, last)(random)] ^= static_cast<char>(random() & 0xffU);
    }
    std::ofstream(broken, std::ios::binary | std::ios::trunc) << bytes;
    const auto began = std::chrono::steady_clock::now();
    const auto file = open_oni_file(broken, {});
    if (!file) {
      EXPECT_THAT(file.error().message, HasSubstr("broken.oni: "));
      ++ends[file.error().message.find("crashed") == std::string::npos ? "refused" : "crashed"];
    } else {
      DepthFrame frame;
      FrameOutcome outcome = FrameOutcome::ok;
      while (outcome != FrameOutcome::end_of_stream && outcome != FrameOutcome::device_lost) {
        outcome = (*file)->next(frame, std::chrono::milliseconds(1000));
      }
      ++ends[outcome == FrameOutcome::device_lost ? "lost" : "played to its end"];
    }
    EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(30)) << round;
  }
  for (const auto& [end, count] : ends) std::printf("%s: %d\n", end.c_str(), count);
}

TEST_F(OniFile, ClosingInTheMiddleAndAtTheEndIsQuiet) {
  const auto path = record();
  for (int frames = 0; frames <= 12; frames += 3) {
    const auto file = open_oni_file(path, {});
    ASSERT_TRUE(file) << file.error().message;
    DepthFrame frame;
    for (int i = 0; i < frames; ++i) ASSERT_EQ((*file)->next(frame, kLong), FrameOutcome::ok);
  }
}

}  // namespace
}  // namespace tubetrack
