#include "run.hpp"

#include <gmock/gmock.h>

#include <array>

#include "apps/program.hpp"
#include "replay/recording_files.hpp"
#include "tubetrack/report/result_json.hpp"

namespace tubetrack {
namespace {

using test::TemporaryFolder;
using testing::HasSubstr;

/// Plays what it is told; every frame uses the same buffer, without keep_alive, as a driver's would.
class ScriptedSource : public FrameSource {
 public:
  explicit ScriptedSource(std::vector<FrameOutcome> script) : script_(std::move(script)) {
    info_.name = "scripted";
    info_.intrinsics = {16, 12, 500.0, 500.0, 7.5, 5.5, {}};
  }
  const StreamInfo& info() const override { return info_; }
  FrameOutcome next(DepthFrame& frame, std::chrono::milliseconds) override {
    const FrameOutcome outcome = at_ < script_.size() ? script_[at_] : FrameOutcome::end_of_stream;
    ++at_;
    frame = {};
    if (outcome != FrameOutcome::ok && outcome != FrameOutcome::corrupt) return outcome;
    frame.index = index_++;
    frame.timestamp_s = 0.1 * static_cast<double>(frame.index);
    if (outcome == FrameOutcome::corrupt) return outcome;
    pixels_.fill(static_cast<std::uint16_t>(1000 + frame.index));
    frame.pixels = pixels_.data();
    frame.width = 16;
    frame.height = 12;
    frame.stride_bytes = 32;
    return outcome;
  }
  const std::string& last_problem() const override { return problem_; }
  std::int64_t dropped() const override { return 3; }

 private:
  StreamInfo info_;
  std::vector<FrameOutcome> script_;
  std::array<std::uint16_t, 16 * 12> pixels_{};
  std::size_t at_ = 0;
  std::int64_t index_ = 0;
  std::string problem_ = "cable pulled";
};

constexpr auto kOk = FrameOutcome::ok;
constexpr auto kTimeout = FrameOutcome::timeout;
constexpr auto kCorrupt = FrameOutcome::corrupt;
constexpr auto kLost = FrameOutcome::device_lost;

class RunTracker : public testing::TestWithParam<bool> {
 protected:
  int run(std::vector<FrameOutcome> script) {
    ScriptedSource source(std::move(script));
    auto tracker = TubeTracker::create({}, source.info().intrinsics);
    options_.realtime = GetParam();
    options_.queue_frames = 100;
    options_.out = folder_ / "a.jsonl";
    testing::internal::CaptureStderr();
    const int exit_code = run_tracker(source, *tracker, options_);
    stderr_ = testing::internal::GetCapturedStderr();
    frames_ = read_result_lines(options_.out).value_or(std::vector<TubeFrame>());
    return exit_code;
  }

  TemporaryFolder folder_;
  RunOptions options_;
  std::string stderr_;
  std::vector<TubeFrame> frames_;
};

TEST_P(RunTracker, WaitsThroughTimeoutsUntilTheStreamEnds) {
  EXPECT_EQ(run({kTimeout, kOk, kTimeout, kTimeout, kOk, kTimeout}), 0) << stderr_;
  ASSERT_EQ(frames_.size(), 2U);
  EXPECT_EQ(frames_[1].frame, 1);
  EXPECT_EQ(frames_[1].dropped, 3) << "what the source dropped is counted";
}

TEST_P(RunTracker, ALostDeviceIsExit1AndKeepsWhatCameBefore) {
  EXPECT_EQ(run({kOk, kOk, kLost}), 1);
  EXPECT_EQ(frames_.size(), 2U);
  EXPECT_THAT(stderr_, HasSubstr("scripted: cable pulled; the 2 frames before are written"));
}

TEST_P(RunTracker, CorruptFramesAreLinesWithTheReason) {
  EXPECT_EQ(run({kOk, kCorrupt, kOk}), 0);
  ASSERT_EQ(frames_.size(), 3U);
  EXPECT_EQ(frames_[1].status, TrackStatus::corrupt);
  EXPECT_EQ(frames_[1].problem, "cable pulled");
  EXPECT_EQ(run({kCorrupt, kCorrupt}), 1);
  EXPECT_EQ(run({}), 1);
  EXPECT_THAT(stderr_, HasSubstr("not one frame came"));
}

TEST_P(RunTracker, OnFrameSeesEveryGoodFrameAndItsErrorEndsTheRun) {
  std::vector<int> seen;
  options_.on_frame = [&seen](const DepthFrame& frame) -> Expected<void> {
    seen.push_back(frame.pixels[0]);
    if (seen.size() == 3) return tl::make_unexpected(Error::failed("disk full"));
    return {};
  };
  EXPECT_EQ(run({kOk, kCorrupt, kOk, kOk, kOk}), 1);
  EXPECT_EQ(seen, (std::vector<int>{1000, 1002, 1003}));
  EXPECT_THAT(stderr_, HasSubstr("tubetrack: disk full"));
}

TEST_P(RunTracker, QueuedFramesKeepTheirOwnPixels) {
  options_.overlay_dir = folder_ / "o";
  EXPECT_EQ(run({kOk, kOk, kOk}), 0) << stderr_;
  EXPECT_EQ(frames_.size(), 3U);
  options_.smallest_radius_m = 1.0005;  // the first frame is 1.000 m away, later ones farther
  EXPECT_EQ(run({kOk, kOk, kOk}), 2);
  EXPECT_THAT(stderr_, HasSubstr("scripted is 1.00 m away"));
}

INSTANTIATE_TEST_SUITE_P(Pace, RunTracker, testing::Bool(),
                         [](const auto& test) { return test.param ? "Realtime" : "Fast"; });

}  // namespace
}  // namespace tubetrack
