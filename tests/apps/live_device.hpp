#pragma once

// `tubetrack` as a user runs it with a live device: the program, the real OpenNI2 runtime, and a synthetic recording as
// its depth camera (docs/live.md). Unless a test says otherwise the device runs in lockstep with what the program has
// written, so no frame is dropped on a slow machine.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
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

namespace tubetrack::test {

namespace fs = std::filesystem;
using nlohmann::json;

inline constexpr int kFrames = 3;
inline constexpr std::chrono::milliseconds kPoll{5};

inline std::string read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline std::vector<json> read_lines(const fs::path& path) {
  std::vector<json> lines;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) lines.push_back(json::parse(line));
  return lines;
}

inline std::int64_t count_lines(const fs::path& path) {
  const std::string text = read_file(path);
  return std::count(text.begin(), text.end(), '\n');
}

class LiveTest : public testing::Test {
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

  LiveTest() : folder_(root_ / testing::UnitTest::GetInstance()->current_test_info()->name()) {
    fs::create_directories(folder_);
    setenv("TUBETRACK_VIRTUAL_DEVICE", recording_.c_str(), 1);
    setenv("TUBETRACK_VIRTUAL_AT_END", "stall", 1);
    setenv("TUBETRACK_VIRTUAL_LOCKSTEP", lines().c_str(), 1);
  }

  ~LiveTest() override {
    for (const char* name : {"SPEED", "FAULTS", "MIRROR", "LOCKSTEP"})
      unsetenv((std::string("TUBETRACK_VIRTUAL_") + name).c_str());
  }

  /// Frames come at their own time, over and over, with these faults.
  void play_on_its_own(const std::string& speed, const std::string& faults = "") {
    unsetenv("TUBETRACK_VIRTUAL_LOCKSTEP");
    setenv("TUBETRACK_VIRTUAL_AT_END", "repeat", 1);
    setenv("TUBETRACK_VIRTUAL_SPEED", speed.c_str(), 1);
    std::ofstream(folder_ / "faults") << faults;
    setenv("TUBETRACK_VIRTUAL_FAULTS", (folder_ / "faults").c_str(), 1);
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

}  // namespace tubetrack::test
