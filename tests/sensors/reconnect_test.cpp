#include "tubetrack/sensors/reconnect.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "stream_clock.hpp"

namespace tubetrack {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
using testing::HasSubstr;

/// Gives its frames' times as good frames, then is lost, or silent for ever.
class Device : public FrameSource {
 public:
  explicit Device(std::vector<double> times_s, bool silent = false, double fx_px = 500.0)
      : times_s_(std::move(times_s)), silent_(silent) {
    info_.name = "device";
    info_.intrinsics = {16, 12, fx_px, 500.0, 7.5, 5.5, {}};
  }
  const StreamInfo& info() const override { return info_; }
  FrameOutcome next(DepthFrame& frame, milliseconds) override {
    frame = {};
    if (at_ == times_s_.size()) return silent_ ? FrameOutcome::timeout : FrameOutcome::device_lost;
    frame.index = static_cast<std::int64_t>(at_);
    frame.timestamp_s = times_s_[at_++];
    return FrameOutcome::ok;
  }
  const std::string& last_problem() const override { return problem_; }
  std::int64_t dropped() const override { return 2; }

 private:
  StreamInfo info_;
  std::vector<double> times_s_;
  bool silent_;
  std::size_t at_ = 0;
  std::string problem_ = "cable pulled";
};

constexpr ReconnectOptions kQuick{milliseconds(5), milliseconds(20), milliseconds(50)};

/// What comes of a source until it gave `outcome`; the good frames.
std::vector<DepthFrame> until(FrameSource& source, FrameOutcome outcome) {
  std::vector<DepthFrame> frames;
  const auto give_up = steady_clock::now() + std::chrono::seconds(10);
  while (steady_clock::now() < give_up) {
    DepthFrame frame;
    const FrameOutcome now = source.next(frame, milliseconds(5));
    if (now == FrameOutcome::ok) frames.push_back(frame);
    if (now == outcome) return frames;
  }
  ADD_FAILURE() << "it never came";
  return frames;
}

TEST(Reconnect, IndicesAndTimesGoOnWhenTheDeviceStartsAnew) {
  const auto source = reconnecting(
      std::make_unique<Device>(std::vector{100.0, 100.1}),
      [] { return Expected<std::unique_ptr<FrameSource>>(std::make_unique<Device>(std::vector{0.5, 0.6, 0.7})); },
      kQuick);
  EXPECT_EQ(until(*source, FrameOutcome::device_lost).size(), 2U);
  EXPECT_EQ(source->last_problem(), "cable pulled");
  EXPECT_EQ(source->dropped(), 2) << "of the device that is gone";
  const auto after = until(*source, FrameOutcome::device_lost);
  ASSERT_EQ(after.size(), 3U);
  EXPECT_EQ(after[0].index, 2);
  EXPECT_EQ(after[2].index, 4);
  EXPECT_GT(after[0].timestamp_s, 100.1);
  EXPECT_LT(after[0].timestamp_s, 110.1) << "by what passed on the host's clock";
  EXPECT_NEAR(after[2].timestamp_s - after[0].timestamp_s, 0.2, 1e-9) << "then the device's own again";
  EXPECT_EQ(source->dropped(), 4);
}

TEST(Reconnect, AClockThatGoesOnIsLeftAlone) {
  const auto source = reconnecting(
      std::make_unique<Device>(std::vector{100.0}),
      [] { return Expected<std::unique_ptr<FrameSource>>(std::make_unique<Device>(std::vector{103.5})); }, kQuick);
  until(*source, FrameOutcome::device_lost);
  EXPECT_EQ(until(*source, FrameOutcome::device_lost).at(0).timestamp_s, 103.5);
}

TEST(Reconnect, AttemptsWaitLongerAndLongerAndTheReasonIsKept) {
  std::vector<steady_clock::time_point> attempts;
  const auto source = reconnecting(
      std::make_unique<Device>(std::vector<double>()),
      [&attempts]() -> Expected<std::unique_ptr<FrameSource>> {
        attempts.push_back(steady_clock::now());
        if (attempts.size() < 5) return tl::make_unexpected(Error::failed("not there"));
        return std::make_unique<Device>(std::vector{1.0});
      },
      kQuick);
  DepthFrame frame;
  EXPECT_EQ(source->next(frame, milliseconds(5)), FrameOutcome::device_lost);
  const auto lost = steady_clock::now();
  while (attempts.empty()) EXPECT_EQ(source->next(frame, milliseconds(5)), FrameOutcome::timeout);
  EXPECT_EQ(source->last_problem(), "not there");
  until(*source, FrameOutcome::ok);
  ASSERT_EQ(attempts.size(), 5U);
  EXPECT_GE(attempts[0] - lost, milliseconds(4));
  for (std::size_t i = 1; i < 5; ++i) EXPECT_GE(attempts[i] - attempts[i - 1], milliseconds(i == 1 ? 9 : 19)) << i;
}

TEST(Reconnect, ASilentDeviceIsLostAfterThatTime) {
  const auto source = reconnecting(
      std::make_unique<Device>(std::vector{1.0}, true),
      [] { return Expected<std::unique_ptr<FrameSource>>(std::make_unique<Device>(std::vector{2.0})); }, kQuick);
  until(*source, FrameOutcome::device_lost);
  EXPECT_EQ(source->last_problem(), "no frame for 0.05 s");
  EXPECT_EQ(until(*source, FrameOutcome::device_lost).size(), 1U);
}

TEST(Reconnect, AnotherCameraIsNotTakenForTheOldOne) {
  int attempts = 0;
  const auto source = reconnecting(
      std::make_unique<Device>(std::vector{1.0}),
      [&attempts] {
        const double fx_px = ++attempts < 3 ? 510.0 : 500.0;
        return Expected<std::unique_ptr<FrameSource>>(std::make_unique<Device>(std::vector{2.0}, false, fx_px));
      },
      kQuick);
  until(*source, FrameOutcome::device_lost);
  DepthFrame frame;
  while (attempts == 0) source->next(frame, milliseconds(5));
  EXPECT_THAT(source->last_problem(), HasSubstr("came back as 16x12, unit 0.001 m, fx 510 px; it was 16x12"));
  EXPECT_EQ(until(*source, FrameOutcome::device_lost).size(), 1U);
  EXPECT_EQ(attempts, 3);
}

TEST(StreamClock, ATimeThatGoesBackIsRefusedOnceAndAClockSetAnewGoesOn) {
  StreamClock clock;
  const auto start = steady_clock::now();
  const auto at = [&](double s) {
    return start + std::chrono::duration_cast<steady_clock::duration>(std::chrono::duration<double>(s));
  };
  EXPECT_EQ(clock.stamp(10.0, at(0.0)), 10.0);
  EXPECT_EQ(clock.stamp(10.1, at(0.1)), 10.1);
  EXPECT_EQ(clock.stamp(9.0, at(0.2)), std::nullopt) << "one wrong stamp";
  EXPECT_EQ(clock.stamp(10.3, at(0.3)), 10.3);
  EXPECT_EQ(clock.stamp(10.3, at(0.35)), std::nullopt) << "standing still";
  EXPECT_EQ(clock.stamp(1.0, at(0.4)), std::nullopt) << "set anew";
  EXPECT_NEAR(clock.stamp(1.1, at(0.5)).value_or(0.0), 10.5, 1e-9) << "seen with the second";
  EXPECT_NEAR(clock.stamp(1.3, at(0.9)).value_or(0.0), 10.7, 1e-9) << "the device's own pace";
}

TEST(StreamClock, AClockThatStandsStillIsReplacedByTheHostsForGood) {
  StreamClock clock;
  const auto start = steady_clock::now();
  const auto stamp = [&](double device_s, int host_ms) { return clock.stamp(device_s, start + milliseconds(host_ms)); };
  EXPECT_EQ(stamp(10.0, 0), 10.0);
  for (int i = 1; i <= 3; ++i) EXPECT_EQ(stamp(10.0, 100 * i), std::nullopt) << i;
  EXPECT_FALSE(clock.by_host());
  EXPECT_NEAR(stamp(10.0, 400).value_or(0.0), 10.4, 1e-9) << "since the last good one";
  EXPECT_TRUE(clock.by_host());
  EXPECT_NEAR(stamp(10.0, 500).value_or(0.0), 10.5, 1e-9);
  EXPECT_NEAR(stamp(12.0, 600).value_or(0.0), 10.6, 1e-9) << "whatever it says now: it may go in steps of a second";
}

}  // namespace
}  // namespace tubetrack
