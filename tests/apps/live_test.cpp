// `tubetrack live`, `record` and `devices` as a user runs them: the program, the real OpenNI2 runtime, and a synthetic
// recording as its depth camera (docs/live.md). The device runs in lockstep with what the program has written, so no
// frame is dropped on a slow machine.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tubetrack/replay/recording.hpp"

namespace tubetrack {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

constexpr int kFrames = 3;
constexpr std::chrono::milliseconds kPoll{5};

std::string read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<json> read_lines(const fs::path& path) {
  std::vector<json> lines;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) lines.push_back(json::parse(line));
  return lines;
}

std::int64_t count_lines(const fs::path& path) {
  const std::string text = read_file(path);
  return std::count(text.begin(), text.end(), '\n');
}

class Live : public testing::Test {
 protected:
  /// One recording for all tests of this program: bent tubes, noise free, in 0.1 mm.
  static void SetUpTestSuite() {
    root_ = fs::path(testing::TempDir()) / ("live_test_" + std::to_string(getpid()));
    fs::create_directories(root_);
    recording_ = root_ / "scene";
    const pid_t pid = start({"synth", "bent", recording_, "--frames", std::to_string(kFrames), "--no-noise"}, root_);
    ASSERT_EQ(wait(pid), 0) << read_file(root_ / "stderr");
  }
  static void TearDownTestSuite() { fs::remove_all(root_); }

  Live() : folder_(root_ / testing::UnitTest::GetInstance()->current_test_info()->name()) {
    fs::create_directories(folder_);
    setenv("TUBETRACK_VIRTUAL_DEVICE", recording_.c_str(), 1);
    setenv("TUBETRACK_VIRTUAL_AT_END", "stall", 1);
    setenv("TUBETRACK_VIRTUAL_LOCKSTEP", lines().c_str(), 1);
  }

  fs::path lines() const { return folder_ / "lines.jsonl"; }

  static pid_t start(const std::vector<std::string>& arguments, const fs::path& folder) {
    std::vector<std::string> all = {TUBETRACK_PROGRAM};
    all.insert(all.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& argument : all) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const std::string out = folder / "stdout";
    const std::string err = folder / "stderr";
    const pid_t pid = fork();
    if (pid == 0) {
      dup2(open(out.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0644), STDOUT_FILENO);
      dup2(open(err.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0644), STDERR_FILENO);
      execv(argv[0], argv.data());
      _exit(127);
    }
    return pid;
  }

  /// The exit code; 1000 plus the signal where one ended it.
  static int wait(pid_t pid) {
    int status = 0;
    waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
  }

  int run(const std::vector<std::string>& arguments) { return wait(start(arguments, folder_)); }
  std::string errors() const { return read_file(folder_ / "stderr"); }
  std::string output() const { return read_file(folder_ / "stdout"); }

  void replay() {
    EXPECT_EQ(run({"replay", recording_, "--no-timing", "--quiet", "--out", folder_ / "replay.jsonl"}), 0) << errors();
  }

  /// The same pixels, timestamps and camera.
  static void expect_same_recording(const fs::path& path) {
    auto written = open_recording(path, {});
    auto played = open_recording(recording_, {});
    ASSERT_TRUE(written) << written.error().message;
    ASSERT_TRUE(played) << played.error().message;
    const StreamInfo& got = written->source->info();
    const StreamInfo& want = played->source->info();
    EXPECT_EQ(got.frame_count, want.frame_count);
    EXPECT_EQ(got.metres_per_unit, want.metres_per_unit);
    EXPECT_EQ(got.intrinsics.fx_px, want.intrinsics.fx_px);
    EXPECT_EQ(got.intrinsics.fy_px, want.intrinsics.fy_px);
    EXPECT_EQ(got.intrinsics.cx_px, want.intrinsics.cx_px);
    EXPECT_EQ(got.intrinsics.cy_px, want.intrinsics.cy_px);
    DepthFrame a;
    DepthFrame b;
    for (int i = 0; i < kFrames; ++i) {
      ASSERT_EQ(written->source->next(a, std::chrono::seconds(60)), FrameOutcome::ok)
          << written->source->last_problem();
      ASSERT_EQ(played->source->next(b, std::chrono::seconds(60)), FrameOutcome::ok) << played->source->last_problem();
      EXPECT_EQ(a.timestamp_s, b.timestamp_s);
      ASSERT_EQ(a.width, b.width);
      ASSERT_EQ(a.height, b.height);
      for (int v = 0; v < a.height; ++v) ASSERT_TRUE(std::equal(a.row(v), a.row(v) + a.width, b.row(v))) << "row " << v;
    }
  }

  static inline fs::path root_;
  static inline fs::path recording_;
  fs::path folder_;
};

const std::string kAll = "0:" + std::to_string(kFrames);

TEST_F(Live, TheLinesAreReplaysByteForByte) {
  replay();
  ASSERT_EQ(run({"live", "--frames", kAll, "--no-timing", "--quiet", "--out", lines()}), 0) << errors();
  const auto live = read_lines(lines());
  ASSERT_EQ(live.size(), static_cast<std::size_t>(kFrames));
  for (const json& line : live) EXPECT_EQ(line["tubes"].size(), 1u) << "an equality of nothing";
  EXPECT_EQ(read_file(lines()), read_file(folder_ / "replay.jsonl"));
}

TEST_F(Live, GivenIntrinsicsAreUsed) {
  ASSERT_EQ(run({"live", "--intrinsics", "285,285,319.5,239.5", "--frames", "0:1", "--out", lines()}), 0) << errors();
  EXPECT_THAT(errors(),
              HasSubstr("virtual:0: 640x480, unit 0.0001 m, fx 285.00, fy 285.00, cx 319.50, cy 239.50 px from "
                        "--intrinsics"));
}

TEST_F(Live, ANoteSaysWhichNoiseModelTheDeviceHasAndTheFlagWins) {
  // The virtual device has the name of its recording's folder.
  const fs::path known = folder_ / "RealSense D435";
  fs::create_directory_symlink(recording_, known);
  ASSERT_EQ(run({"live", "--frames", "0:1", "--out", lines()}), 0) << errors();
  EXPECT_THAT(errors(), HasSubstr("note: noise model kinect1 for tubetrack "));
  EXPECT_THAT(errors(), HasSubstr("not known, --noise says it"));
  setenv("TUBETRACK_VIRTUAL_DEVICE", known.c_str(), 1);
  fs::remove(lines());
  ASSERT_EQ(run({"live", "--frames", "0:1", "--out", lines()}), 0) << errors();
  EXPECT_THAT(errors(), HasSubstr("(by the device's name)"));
  EXPECT_THAT(errors(), HasSubstr("note: noise model stereo for tubetrack "));
  fs::remove(lines());
  ASSERT_EQ(run({"live", "--noise", "tof", "--frames", "0:1", "--out", lines()}), 0) << errors();
  EXPECT_THAT(errors(), HasSubstr("note: noise model tof for tubetrack "));
  EXPECT_THAT(errors(), HasSubstr("(as --noise says)"));
}

TEST_F(Live, AFrameRangePassesOverWhatComesBefore) {
  // Lockstep counts lines, and frames passed over write none.
  unsetenv("TUBETRACK_VIRTUAL_LOCKSTEP");
  setenv("TUBETRACK_VIRTUAL_AT_END", "repeat", 1);
  setenv("TUBETRACK_VIRTUAL_SPEED", "0.1", 1);
  ASSERT_EQ(run({"live", "--frames", "1:3", "--quiet", "--out", lines()}), 0) << errors();
  unsetenv("TUBETRACK_VIRTUAL_SPEED");
  for (const json& line : read_lines(lines())) {
    EXPECT_GE(line["frame"], 1);
    EXPECT_LT(line["frame"], 3);
  }
}

TEST_F(Live, RecordsWhatItTracks) {
  ASSERT_EQ(run({"live", "--frames", kAll, "--quiet", "--record", folder_ / "recorded", "--out", lines()}), 0)
      << errors();
  expect_same_recording(folder_ / "recorded");
}

TEST_F(Live, RecordThenReplayIsBitExact) {
  const fs::path recorded = folder_ / "recorded";
  std::atomic<bool> done = false;
  // depth.txt has one line more than frames; the device is to see the frames alone.
  std::thread lockstep([&] {
    for (std::int64_t told = 0; !done; std::this_thread::sleep_for(kPoll)) {
      for (; told < count_lines(recorded / "depth.txt") - 1; ++told) std::ofstream(lines(), std::ios::app) << "\n";
    }
  });
  const int exit_code = run({"record", recorded, "--frames", kAll});
  done = true;
  lockstep.join();
  ASSERT_EQ(exit_code, 0) << errors();
  EXPECT_THAT(errors(), HasSubstr(std::to_string(kFrames) + " frames recorded, 0 dropped, 0 corrupt"));
  expect_same_recording(recorded);
}

TEST_F(Live, CtrlCEndsASilentDeviceWithWholeLinesAndExitCode0) {
  const pid_t pid = start({"live", "--quiet", "--out", lines()}, folder_);
  while (count_lines(lines()) < kFrames && waitpid(pid, nullptr, WNOHANG) == 0) std::this_thread::sleep_for(kPoll);
  kill(pid, SIGINT);
  EXPECT_EQ(wait(pid), 0) << errors();
  EXPECT_EQ(read_lines(lines()).size(), static_cast<std::size_t>(kFrames));
  EXPECT_THAT(read_file(lines()), testing::EndsWith("\n"));
}

TEST_F(Live, AnUnpluggedDeviceIsExitCode1AndTheFramesBeforeAreKept) {
  setenv("TUBETRACK_VIRTUAL_AT_END", "unplug", 1);
  EXPECT_EQ(run({"live", "--quiet", "--out", lines()}), 1);
  EXPECT_THAT(errors(), HasSubstr("virtual:0: the device was unplugged; the "));
  EXPECT_GE(read_lines(lines()).size(), static_cast<std::size_t>(kFrames - 1));
}

TEST_F(Live, DevicesListsTheUriATabAndTheName) {
  EXPECT_EQ(run({"devices"}), 0) << errors();
  EXPECT_EQ(output(), "virtual:0\ttubetrack recording scene\n");
}

TEST_F(Live, WithoutADeviceTheErrorSaysWhatToDo) {
  unsetenv("TUBETRACK_VIRTUAL_DEVICE");
  const std::string message =
      "tubetrack: no OpenNI2 device found; plugged in? `tubetrack devices` lists them; without a sensor: "
      "scripts/virtual-device RECORDING tubetrack live\n";
  EXPECT_EQ(run({"live"}), 1);
  EXPECT_EQ(errors(), message);
  EXPECT_EQ(run({"record", folder_ / "recorded"}), 1);
  EXPECT_EQ(errors(), message);
  EXPECT_FALSE(fs::exists(folder_ / "recorded"));
  EXPECT_EQ(run({"devices"}), 0);
  EXPECT_EQ(output(), "");
  EXPECT_THAT(errors(), HasSubstr("no OpenNI2 device found"));
}

TEST_F(Live, WrongUseIsExitCode2InOneLineThatNamesTheFlag) {
  const auto refused = [this](std::vector<std::string> arguments) {
    EXPECT_EQ(run(arguments), 2) << errors();
    return errors();
  };
  EXPECT_EQ(refused({"live", "--deadline-ms", "5"}),
            "tubetrack: --deadline-ms: is not in this version; leave it out\n");
  EXPECT_EQ(refused({"live", "--depth-scale", "0.001"}),
            "tubetrack: --depth-scale: a device says its own unit; leave it out\n");
  EXPECT_THAT(refused({"live", "--intrinsics", "0,570,319.5,239.5"}),
              HasSubstr("--intrinsics 0,570,319.5,239.5: takes"));
  EXPECT_THAT(refused({"record"}), HasSubstr("PATH"));
  EXPECT_THAT(refused({"record", "a", "b", "c"}), HasSubstr("see tubetrack record --help"));
}

}  // namespace
}  // namespace tubetrack
