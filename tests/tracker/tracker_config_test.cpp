#include "tubetrack/tracker/tracker_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct Refused {
  const char* field;
  const char* got;
  TrackerConfig config;
};

void PrintTo(const Refused& refused, std::ostream* out) {
  *out << refused.field << " = " << refused.got;
}

TrackerConfig with(auto change) {
  TrackerConfig config;
  change(config);
  return config;
}

class RefusedConfig : public ::testing::TestWithParam<Refused> {};

TEST_P(RefusedConfig, TheErrorIsOneLineWithTheFieldTheValueAndWhatItTakes) {
  const auto valid = validate(GetParam().config);
  ASSERT_FALSE(valid);
  EXPECT_EQ(valid.error().kind, Error::Kind::usage);
  EXPECT_THAT(valid.error().message,
              AllOf(HasSubstr(GetParam().field), HasSubstr(GetParam().got), HasSubstr("takes "), Not(HasSubstr("\n"))));
}

const double kNan = std::numeric_limits<double>::quiet_NaN();
const double kInfinite = std::numeric_limits<double>::infinity();

INSTANTIATE_TEST_SUITE_P(
    Fields, RefusedConfig,
    ::testing::Values(Refused{"radius_m", "got 0", with([](auto& c) { c.radius_m = 0.0; })},
                      Refused{"radius_m", "got -0.02", with([](auto& c) { c.radius_m = -0.02; })},
                      Refused{"radius_m", "got nan", with([](auto& c) { c.radius_m = kNan; })},
                      Refused{"radius_m", "got inf", with([](auto& c) { c.radius_m = kInfinite; })},
                      Refused{"radius_m", "got 25", with([](auto& c) { c.radius_m = 25.0; })},
                      Refused{"radius_m", "millimetres", with([](auto& c) {
                                c.radius_m = 2.0;
                                c.depth_max_m = 1.5;
                              })},
                      Refused{"radius_min_m", "got 0", with([](auto& c) { c.radius_min_m = 0.0; })},
                      Refused{"radius_max_m", "got 0.004", with([](auto& c) { c.radius_max_m = 0.004; })},
                      Refused{"radius_max_m", "got 30", with([](auto& c) { c.radius_max_m = 30.0; })},
                      Refused{"depth_min_m", "got -1", with([](auto& c) { c.depth_min_m = -1.0; })},
                      Refused{"depth_max_m", "got 0.1", with([](auto& c) { c.depth_max_m = 0.1; })},
                      Refused{"depth_max_m", "got nan", with([](auto& c) { c.depth_max_m = kNan; })},
                      Refused{"roi", "got -5", with([](auto& c) { c.roi_u_px = -5; })},
                      Refused{"roi", "got -640", with([](auto& c) { c.roi_width_px = -640; })},
                      Refused{"min_length_radii", "got 0", with([](auto& c) { c.min_length_radii = 0.0; })},
                      Refused{"min_length_m", "got -0.1", with([](auto& c) { c.min_length_m = -0.1; })},
                      Refused{"min_width_px", "got 2", with([](auto& c) { c.min_width_px = 2.0; })},
                      Refused{"min_bend_radii", "got 0.5", with([](auto& c) { c.min_bend_radii = 0.5; })},
                      Refused{"cell_m", "got 0", with([](auto& c) { c.cell_m = 0.0; })},
                      Refused{"deadline_ms", "got 0", with([](auto& c) { c.deadline_ms = 0.0; })},
                      Refused{"threads", "got 0", with([](auto& c) { c.threads = 0; })},
                      Refused{"threads", "got 1000", with([](auto& c) { c.threads = 1000; })}));

TEST(TrackerConfig, DefaultsAreValid) {
  EXPECT_TRUE(validate(TrackerConfig{}));
}

TEST(TrackerConfig, TheEndsOfTheRangesAreValid) {
  EXPECT_TRUE(validate(with([](auto& c) { c.radius_m = 1e-4; })));
  EXPECT_TRUE(validate(with([](auto& c) { c.radius_max_m = c.radius_min_m; })));
  EXPECT_TRUE(validate(with([](auto& c) { c.cell_m = 0.1; })));
  EXPECT_TRUE(validate(with([](auto& c) { c.threads = 16; })));
}

TEST(TubeTracker, IsNotCreatedWithAConfigThatCannotBeUsed) {
  const auto tracker =
      TubeTracker::create(with([](auto& c) { c.radius_m = 0.0; }), {640, 480, 570, 570, 319.5, 239.5, {}});
  ASSERT_FALSE(tracker);
  EXPECT_THAT(tracker.error().message, HasSubstr("radius_m: got 0"));
}

TEST(TubeTracker, IsNotCreatedWithIntrinsicsThatCannotBeUsed) {
  const auto tracker = TubeTracker::create({}, {640, 480, 0.0, 570, 319.5, 239.5, {}});
  ASSERT_FALSE(tracker);
  EXPECT_THAT(tracker.error().message, HasSubstr("fx"));
}

TEST(TubeTracker, AFrameOfAnotherSizeIsCorruptAndTheNextGoesOn) {
  auto tracker = TubeTracker::create({}, {32, 24, 30, 30, 15.5, 11.5, {}});
  ASSERT_TRUE(tracker);
  const std::vector<std::uint16_t> pixels(32 * 24, 800);
  DepthFrame frame{pixels.data(), 16, 24, 32};
  EXPECT_EQ(tracker->track(frame).status, TrackStatus::corrupt);
  EXPECT_THAT(tracker->track(frame).problem, HasSubstr("16"));
  frame.width = 32;
  frame.stride_bytes = 64;
  frame.index = 7;
  const TubeFrame& result = tracker->track(frame);
  EXPECT_EQ(result.status, TrackStatus::empty);
  EXPECT_EQ(result.frame, 7);
  frame.pose_missing = true;
  EXPECT_EQ(tracker->track(frame).status, TrackStatus::no_pose);
}

}  // namespace
}  // namespace tubetrack
