#include "tubetrack/report/summary.hpp"

#include <gmock/gmock.h>

namespace tubetrack {
namespace {

using testing::HasSubstr;

TubeFrame frame_with(std::int64_t number, TrackStatus status, std::vector<std::int64_t> ids) {
  TubeFrame frame;
  frame.frame = number;
  frame.status = status;
  frame.latency_ms = static_cast<double>(number + 1);
  for (const auto id : ids) {
    Tube tube;
    tube.id = id;
    tube.radius_m = 0.02 + 0.001 * static_cast<double>(number);
    tube.length_m = 0.5;
    frame.tubes.push_back(tube);
  }
  return frame;
}

TEST(Summary, AFrameWhoseTimeWasOverIsNotBadAndItsTubesCount) {
  RunSummary summary;
  add_frame(summary, frame_with(0, TrackStatus::deadline, {1}));
  EXPECT_EQ(bad_frames(summary), 0);
  EXPECT_THAT(summary_text(summary), HasSubstr("frames 1, with tubes 1, bad 0, past the deadline 1, dropped 0\n"));
}

TEST(Summary, CountsFramesTubesAndTimes) {
  RunSummary summary;
  add_frame(summary, frame_with(0, TrackStatus::ok, {1}));
  add_frame(summary, frame_with(1, TrackStatus::corrupt, {}));
  add_frame(summary, frame_with(2, TrackStatus::ok, {1, 4}));
  add_frame(summary, frame_with(3, TrackStatus::empty, {}));
  TubeFrame last = frame_with(4, TrackStatus::ok, {1});
  last.dropped = 6;
  add_frame(summary, last);
  EXPECT_EQ(bad_frames(summary), 1);
  const std::string text = summary_text(summary);
  EXPECT_THAT(text, HasSubstr("frames 5, with tubes 3, bad 1 (1 corrupt), dropped 6\n"));
  EXPECT_THAT(text, HasSubstr("tubes 2"));
  EXPECT_THAT(text, HasSubstr("    1       22.0        500        3  0-4\n"));
  EXPECT_THAT(text, HasSubstr("    4       22.0        500        1  2-2\n"));
  // Frames 0, 2, 3 and 4 were tracked, in 1, 3, 4 and 5 ms.
  EXPECT_THAT(text, HasSubstr("latency          3.00     5.00\n"));
}

TEST(Summary, FitsOnAPageWithAnyNumberOfTubes) {
  RunSummary summary;
  for (std::int64_t id = 0; id < 500; ++id) add_frame(summary, frame_with(id, TrackStatus::ok, {id}));
  const std::string text = summary_text(summary);
  EXPECT_LT(std::count(text.begin(), text.end(), '\n'), 40);
  EXPECT_THAT(text, HasSubstr("and 480 more"));
}

TEST(Summary, ALiveRunTellsItsLossesItsLatencyAndWhoDropped) {
  RunSummary summary;
  TubeFrame frame = frame_with(0, TrackStatus::ok, {1});
  frame.dropped = 5;
  add_frame(summary, frame);
  summary.live.result_ms.add(12.5F);
  summary.live.jitter_ms.add(0.75F);
  summary.live.device_dropped = 3;
  summary.live.losses = 2;
  summary.live.lost_s = 7.5;
  const std::string text = summary_text(summary);
  EXPECT_THAT(text, HasSubstr("dropped 5 (3 by the device), lost 2 times for 7.5 s in all\n"));
  EXPECT_THAT(text, HasSubstr("to result       12.50    12.50\n"));
  EXPECT_THAT(text, HasSubstr("jitter           0.75     0.75\n"));
}

TEST(Summary, ForgetsTubesThatWereHardlySeenAndCountsThem) {
  RunSummary summary;
  for (std::int64_t id = 0; id < 5000; ++id) {
    add_frame(summary, frame_with(id, TrackStatus::ok,
                                  id % 2 == 0 ? std::vector<std::int64_t>{id, 0} : std::vector<std::int64_t>{id}));
  }
  EXPECT_LE(summary.tubes.size(), 1000U);
  EXPECT_EQ(static_cast<std::int64_t>(summary.tubes.size()) + summary.tubes_forgotten, 5000);
  EXPECT_EQ(summary.tubes.count(0), 1U) << "the one that was seen the longest";
}

TEST(Quantiles, AreExactForFewValuesAndNearForMany) {
  Quantiles few;
  for (int i = 1; i <= 100; ++i) few.add(static_cast<float>(i));
  EXPECT_EQ(few.at(0.5), 50.0);
  EXPECT_EQ(few.at(0.99), 99.0);
  EXPECT_EQ(Quantiles().at(0.5), 0.0);
  Quantiles many(512);
  for (int i = 0; i < 100000; ++i) many.add(static_cast<float>(i));
  EXPECT_NEAR(many.at(0.5), 50000.0, 500.0);
  EXPECT_NEAR(many.at(0.99), 99000.0, 500.0);
}

}  // namespace
}  // namespace tubetrack
