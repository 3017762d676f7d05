// The program with libcamera, udev and the kernel's USB camera driver as they are, in an emulated machine (`run`): a
// camera is plugged in, sends frames, and is pulled out again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <thread>
#include <vector>

#include "apps/program.hpp"
#include "emulated_machine/usb_camera.hpp"
#include "tubetrack/replay/recording.hpp"

namespace tubetrack {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;
using std::chrono::steady_clock;
using test::Program;
using test::ProgramEnd;
using test::UsbCamera;
using testing::HasSubstr;

constexpr std::chrono::milliseconds kPoll{20};
/// A frame is some transfers long, and tracking it takes the emulated machine half a second.
const test::UsbCameraSettings kCamera{{"Y12 "}, 320, 240, 10};

double seconds_since(steady_clock::time_point begin) {
  return std::chrono::duration<double>(steady_clock::now() - begin).count();
}

template <class Condition>
bool within(seconds patience, const Condition& condition) {
  const auto give_up = steady_clock::now() + patience;
  while (!condition()) {
    if (steady_clock::now() > give_up) return false;
    std::this_thread::sleep_for(kPoll);
  }
  return true;
}

class RealKernel : public testing::Test {
 protected:
  RealKernel() : folder_(fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name()) {
    fs::create_directories(folder_);
  }

  /// The device files are there, and udev has seen to them.
  static void wait_for_camera() {
    EXPECT_TRUE(within(seconds(20), [] { return fs::exists("/dev/video0") && fs::exists("/run/udev/data/c81:0"); }));
    std::this_thread::sleep_for(std::chrono::milliseconds(600));  // as the program does: reconnecting, libcamera_source
  }
  static void wait_until_gone() {
    EXPECT_TRUE(within(seconds(20), [] { return !fs::exists("/dev/video0"); }));
  }

  std::vector<std::string> with_camera(std::vector<std::string> arguments) const {
    for (const char* flag : {"--depth-scale", "0.001", "--intrinsics", "288,288,159.5,119.5"}) {
      arguments.emplace_back(flag);
    }
    return arguments;
  }

  /// The frames of a recording, each compared with what the camera sent under the number that it carries. Numbers rise
  /// but where the camera was plugged in anew. The times are the kernel's, of when the frames were sent.
  std::vector<int> numbers_of_exact_frames(const fs::path& path) const {
    std::vector<int> numbers;
    auto recording = open_recording(path, {});
    EXPECT_TRUE(recording) << recording.error().message;
    DepthFrame frame;
    double last_s = 0.0;
    while (recording && recording->source->next(frame, seconds(60)) == FrameOutcome::ok) {
      numbers.push_back(frame.row(0)[0]);
      EXPECT_GT(frame.timestamp_s, last_s);
      last_s = frame.timestamp_s;
      std::int64_t wrong = 0;
      for (int v = 0; v < frame.height; ++v) {
        for (int u = 0; u < frame.width; ++u) {
          if (frame.row(v)[u] != test::usb_camera_pixel(numbers.back(), u, v, frame.width, frame.height)) ++wrong;
        }
      }
      EXPECT_EQ(wrong, 0) << "pixels of frame " << numbers.back();
    }
    return numbers;
  }

  fs::path folder_;
};

TEST_F(RealKernel, DevicesListsTheCameraForAsLongAsItIsPluggedIn) {
  {
    const UsbCamera camera(kCamera);
    wait_for_camera();
    const ProgramEnd listed = Program(folder_, {"devices"}).wait();
    EXPECT_EQ(listed.exit_code, 0);
    std::printf("%s", listed.out.c_str());
    EXPECT_THAT(listed.out, testing::MatchesRegex("libcamera:[^\t\n]+-1209:0001\tlibcamera USB depth camera.*\n"));
  }
  wait_until_gone();
  const ProgramEnd listed = Program(folder_, {"devices"}).wait();
  EXPECT_EQ(listed.exit_code, 0);
  EXPECT_EQ(listed.out, "");
}

TEST_F(RealKernel, WhatIsRecordedIsWhatTheCameraSentBitForBitAndWhatIsMissingIsCounted) {
  const UsbCamera camera(kCamera);
  wait_for_camera();
  const fs::path path = folder_ / "recorded";
  const auto began = steady_clock::now();
  const ProgramEnd end = Program(folder_, with_camera({"record", "libcamera", path, "--frames", "0:20"})).wait();
  ASSERT_EQ(end.exit_code, 0) << end.err;
  std::printf("%s%.1f s\n", end.err.c_str(), seconds_since(began));
  const std::vector<int> numbers = numbers_of_exact_frames(path);
  ASSERT_FALSE(numbers.empty());
  for (std::size_t i = 1; i < numbers.size(); ++i) EXPECT_GT(numbers[i], numbers[i - 1]);
  const std::size_t sent = static_cast<std::size_t>(numbers.back() - numbers.front()) + 1;
  EXPECT_LE(sent, 20U);
  EXPECT_THAT(end.err, HasSubstr(std::to_string(numbers.size()) + " frames recorded, "));
  EXPECT_THAT(end.err, HasSubstr(", 0 corrupt"));
}

TEST_F(RealKernel, ACameraThatSendsY16AndZ16AloneIsRefusedWithTheVersionThatTakesIt) {
  const UsbCamera camera({{"Y16 ", "Z16 "}});
  wait_for_camera();
  const ProgramEnd end = Program(folder_, with_camera({"live", "libcamera"})).wait();
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, testing::StartsWith("tubetrack: libcamera "));
  EXPECT_THAT(end.err, HasSubstr("lists no camera"));
  EXPECT_THAT(end.err, HasSubstr("libcamera 0.3.0 and later take those (as R16)"));
  EXPECT_EQ(end.error_lines().size(), 1U) << end.err;
  std::printf("%s", end.err.c_str());
}

TEST_F(RealKernel, FourTimesPulledOutAndPluggedInAgainTheRunGoesOnAndItsRecordingIsExact) {
  auto camera = std::make_unique<UsbCamera>(kCamera);
  wait_for_camera();
  const fs::path recorded = folder_ / "recorded";
  Program live(folder_, with_camera({"live", "libcamera", "--radius", "0.04", "--record", recorded}));
  const auto lines = [this] { return test::lines_of(test::read_text(folder_ / "stdout.txt")).size(); };
  const auto told = [this](const std::string& what) {
    const std::string text = test::read_text(folder_ / "stderr.txt");
    int count = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
    return count;
  };
  const auto more_lines = [&](std::size_t count) {
    const std::size_t seen = lines();
    return within(seconds(60), [&] { return lines() >= seen + count || !live.running(); });
  };
  for (int cycle = 1; cycle <= 4; ++cycle) {
    ASSERT_TRUE(more_lines(4)) << "before it is pulled out, cycle " << cycle;
    ASSERT_TRUE(live.running()) << test::read_text(folder_ / "stderr.txt");
    auto at = steady_clock::now();
    camera.reset();
    ASSERT_TRUE(within(seconds(20), [&] { return told("waiting for it to be back") == cycle || !live.running(); }));
    const double noticed_s = seconds_since(at);
    wait_until_gone();
    std::this_thread::sleep_for(seconds(1));
    camera = std::make_unique<UsbCamera>(kCamera);
    at = steady_clock::now();
    ASSERT_TRUE(within(seconds(30), [&] { return told("is back") == cycle || !live.running(); }))
        << test::read_text(folder_ / "stderr.txt");
    std::printf("cycle %d: missed after %.2f s, back %.2f s after it was plugged in\n", cycle, noticed_s,
                seconds_since(at));
  }
  ASSERT_TRUE(more_lines(4));
  live.send(SIGINT);
  const ProgramEnd end = live.wait();
  EXPECT_EQ(end.exit_code, 0) << end.err;
  std::int64_t last_frame = -1;
  double last_s = -1.0;
  nlohmann::json last;
  for (const std::string& line : end.out_lines()) {
    last = nlohmann::json::parse(line);
    EXPECT_EQ(last["status"], "ok") << line;
    EXPECT_GT(last["frame"], last_frame);
    EXPECT_GT(last["timestamp_s"], last_s);
    last_frame = last["frame"];
    last_s = last["timestamp_s"];
  }
  ASSERT_EQ(last["tubes"].size(), 1U) << last;
  EXPECT_THAT(end.err, HasSubstr("lost 4 times"));
  std::printf("%s", end.err.c_str());
  const std::vector<int> numbers = numbers_of_exact_frames(recorded);
  // Frames that came after the last line are recorded as well.
  std::smatch by_device;
  ASSERT_TRUE(std::regex_search(end.err, by_device, std::regex("\\(([0-9]+) by the device\\)")));
  const std::int64_t counted = static_cast<std::int64_t>(numbers.size()) + std::stoll(by_device[1]);
  EXPECT_GE(counted, last_frame + 1);
  EXPECT_LE(counted, last_frame + 100);
}

}  // namespace
}  // namespace tubetrack
