// `--view`: the program's window on a screen of Xvfb's, which keeps the screen's pixels in a file.
#include <gmock/gmock.h>

#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/live_device.hpp"
#include "tubetrack/report/overlay.hpp"
#include "tubetrack/report/result_json.hpp"

namespace tubetrack {
namespace {

namespace fs = std::filesystem;
using test::count_lines;
using test::kFrames;
using test::kPoll;
using test::read_file;
using testing::HasSubstr;

bool in_path(const char* program) {
  return std::system((std::string("command -v ") + program + " >/dev/null").c_str()) == 0;
}

/// Starts a program that is looked for in the PATH; its descriptor `fd`, where that is not negative, is ours as it is.
pid_t start_program(std::vector<std::string> words) {
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t pid = fork();
  if (pid == 0) {
    const int nowhere = open("/dev/null", O_RDWR);
    for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) dup2(nowhere, fd);
    execvp(argv[0], argv.data());
    _exit(127);
  }
  return pid;
}

class View : public test::LiveTest {
 protected:
  void SetUp() override {
    if (!fs::exists(fs::path(TUBETRACK_PROGRAM).parent_path() / "tubetrack_window")) {
      GTEST_SKIP() << "built without the window: install libopencv-highgui-dev";
    }
    if (!in_path("Xvfb")) GTEST_SKIP() << "no screen to show it on: install xvfb";
    int ends[2] = {};
    ASSERT_EQ(pipe(ends), 0);
    screen_pid_ = start_program({"Xvfb", "-displayfd", std::to_string(ends[1]), "-screen", "0", "900x700x24",
                                 "-nolisten", "tcp", "-fbdir", folder_});
    close(ends[1]);
    char number[16] = {};
    EXPECT_GT(read(ends[0], number, sizeof number - 1), 0) << "Xvfb does not start";
    close(ends[0]);
    display_ = ":" + std::to_string(std::atoi(number));
    setenv("DISPLAY", display_.c_str(), 1);
  }

  ~View() override {
    stop_screen();
    unsetenv("DISPLAY");
  }

  void stop_screen() {
    if (screen_pid_ <= 0) return;
    kill(screen_pid_, SIGTERM);
    waitpid(screen_pid_, nullptr, 0);
    screen_pid_ = 0;
  }

  /// The screen as it is now. The file is a window dump (XWD): 32-bit words, high byte first, then colours, then
  /// pixels.
  cv::Mat screenshot() const {
    std::string bytes = read_file(folder_ / "Xvfb_screen0");
    const auto word = [&](std::size_t i) {
      std::uint32_t value = 0;
      for (std::size_t k = 0; k < 4; ++k) value = value << 8 | static_cast<std::uint8_t>(bytes.at(4 * i + k));
      return value;
    };
    const std::size_t pixels = word(0) + 12 * word(19);
    const int width = static_cast<int>(word(4));
    const int height = static_cast<int>(word(5));
    const std::size_t row_bytes = word(12);
    EXPECT_EQ(word(11), 32U) << "bits a pixel";
    EXPECT_GE(bytes.size(), pixels + row_bytes * static_cast<std::size_t>(height));
    cv::Mat picture;
    cv::cvtColor(cv::Mat(height, width, CV_8UC4, bytes.data() + pixels, row_bytes), picture, cv::COLOR_BGRA2BGR);
    return picture;
  }

  /// How far the screen's best match is from the picture, mean of the absolute differences of 0…255.
  static double difference(const cv::Mat& screen, const cv::Mat& picture) {
    cv::Mat match;
    cv::matchTemplate(screen, picture, match, cv::TM_SQDIFF);
    cv::Point at;
    cv::minMaxLoc(match, nullptr, nullptr, &at, nullptr);
    cv::Mat apart;
    cv::absdiff(screen(cv::Rect(at, picture.size())), picture, apart);
    const cv::Scalar mean = cv::mean(apart);
    return (mean[0] + mean[1] + mean[2]) / 3.0;
  }

  static bool within_20_s(const std::function<bool()>& condition) {
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!condition()) {
      if (std::chrono::steady_clock::now() > give_up) return false;
      std::this_thread::sleep_for(10 * kPoll);
    }
    return true;
  }

  /// A live run that shows the recording's frames, then a silent device.
  pid_t start_view() {
    const pid_t pid = start({"live", "--view", "--quiet", "--noise", "synthetic", "--out", lines()}, folder_);
    EXPECT_TRUE(within_20_s([&] { return count_lines(lines()) == kFrames; })) << errors();
    return pid;
  }

  pid_t screen_pid_ = 0;
  std::string display_;
};

TEST_F(View, ShowsTheNewestFrameWithItsTubesInTrueSizeAndQEndsTheRun) {
  const pid_t pid = start_view();
  const auto results = read_result_lines(lines());
  ASSERT_TRUE(results) << results.error().message;
  auto recording = open_recording(recording_, {});
  ASSERT_TRUE(recording);
  DepthFrame frame;
  for (int i = 0; i < kFrames; ++i) {
    ASSERT_EQ(recording->source->next(frame, std::chrono::seconds(60)), FrameOutcome::ok);
  }
  ASSERT_FALSE(results->back().tubes.empty());
  Picture expected = draw_view(frame, recording->source->info().intrinsics, results->back());
  const cv::Mat picture(expected.height, expected.width, CV_8UC3, expected.bgr.data());
  cv::Mat screen;
  EXPECT_TRUE(within_20_s([&] {
    screen = screenshot();
    return difference(screen, picture) < 0.5;
  })) << difference(screen, picture);
  if (const char* keep = std::getenv("TUBETRACK_SCREENSHOT")) cv::imwrite(keep, screen);
  // Not a matter of the depth alone.
  TubeFrame without = results->back();
  without.tubes.clear();
  Picture bare = draw_view(frame, recording->source->info().intrinsics, without);
  EXPECT_GT(difference(screen, cv::Mat(bare.height, bare.width, CV_8UC3, bare.bgr.data())), 0.5);
  if (!in_path("xdotool")) {
    kill(pid, SIGINT);
    wait(pid);
    GTEST_SKIP() << "no xdotool to press a key with: install it";
  }
  wait(start_program(
      {"xdotool", "search", "--name", "tubetrack: virtual:0", "mousemove", "--window", "%1", "50", "50", "key", "q"}));
  EXPECT_EQ(wait(pid), 0) << errors();
}

TEST_F(View, AWindowThatGoesAwayEndsTheRunAsCtrlC) {
  const pid_t pid = start_view();
  stop_screen();
  EXPECT_EQ(wait(pid), 0) << errors();
  EXPECT_EQ(errors(), "");
}

TEST_F(View, DrawingDoesNotHoldUpTracking) {
  ASSERT_EQ(run({"replay", recording_, "--view", "--no-timing", "--quiet", "--out", folder_ / "view.jsonl"}), 0)
      << errors();
  replay();
  EXPECT_EQ(read_file(folder_ / "view.jsonl"), read_file(folder_ / "replay.jsonl"));
}

TEST_F(View, WithoutADisplayTheErrorSaysSoInOneLine) {
  stop_screen();
  setenv("DISPLAY", ":4711", 1);
  EXPECT_EQ(run({"replay", recording_, "--view", "--out", lines()}), 1);
  EXPECT_THAT(errors(),
              HasSubstr("tubetrack: --view: the window can't be opened; DISPLAY is :4711; run it on a desktop, "
                        "or leave --view out\n"));
}

}  // namespace
}  // namespace tubetrack
