// What goes wrong with live devices, against the real OpenNI2 runtime: the virtual device's faults (docs/live.md), by
// script and by Device::invoke, and what the source makes of them.
#include <OpenNI.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <string>
#include <vector>

#include "faults.hpp"
#include "sensors/virtual_device_test.hpp"

namespace tubetrack {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
using test::kLong;
using testing::HasSubstr;

class OpenNi2Faults : public test::VirtualDeviceTest {
 protected:
  /// What a stream gave until `enough` good frames had come.
  struct Seen {
    std::vector<std::int64_t> good;
    std::vector<std::int64_t> corrupt;
    std::vector<double> timestamps_s;
    int losses = 0;
  };

  Seen watch(FrameSource& source, std::size_t enough, milliseconds at_most = milliseconds(20000)) {
    Seen seen;
    DepthFrame frame;
    const auto give_up = steady_clock::now() + at_most;
    while (seen.good.size() < enough && steady_clock::now() < give_up) {
      const FrameOutcome outcome = source.next(frame, milliseconds(50));
      if (outcome == FrameOutcome::device_lost) ++seen.losses;
      if (outcome == FrameOutcome::corrupt) seen.corrupt.push_back(frame.index);
      if (outcome != FrameOutcome::ok) continue;
      seen.good.push_back(frame.index);
      seen.timestamps_s.push_back(frame.timestamp_s);
      EXPECT_NE(frame.received, steady_clock::time_point{});
    }
    EXPECT_GE(seen.good.size(), enough);
    return seen;
  }

  static void expect_rising(const Seen& seen) {
    for (std::size_t i = 1; i < seen.good.size(); ++i) {
      EXPECT_GT(seen.good[i], seen.good[i - 1]);
      EXPECT_GT(seen.timestamps_s[i], seen.timestamps_s[i - 1]);
    }
  }

  std::unique_ptr<FrameSource> open_reconnecting() {
    ReconnectOptions reconnect;
    reconnect.first_wait = milliseconds(20);
    auto source = open_openni2_reconnecting("", {}, reconnect);
    EXPECT_TRUE(source) << (source ? "" : source.error().message);
    return source ? std::move(*source) : nullptr;
  }
};

TEST_F(OpenNi2Faults, AScriptIsReadLineByLineAndAWrongOneNamesItsLine) {
  const auto path = folder_ / "script";
  std::ofstream(path)
      << "# what goes wrong\n\n10 stall 2.5\n 10 unplug   # for good\n20 time -0.5\n30 burst 4\n31 drop\n";
  const auto script = read_fault_script(path);
  ASSERT_TRUE(script) << script.error().message;
  ASSERT_EQ(script->size(), 5U);
  EXPECT_EQ((*script)[0].kind, FaultKind::stall);
  EXPECT_EQ((*script)[0].amount, 2.5);
  EXPECT_EQ((*script)[0].frame, 10);
  EXPECT_EQ((*script)[1].amount, -1.0);
  EXPECT_EQ((*script)[4].amount, 1.0);
  for (const char* wrong : {"10 explode", "ten stall 1", "-1 stall 1", "10 stall", "10 stall -1", "10 stall 1 2",
                            "1.5 stall 1", "10 stall inf", "10"}) {
    std::ofstream(path) << "1 drop\n" << wrong << "\n";
    const auto refused = read_fault_script(path);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_THAT(refused.error().message, HasSubstr("script:2: got '" + std::string(wrong) + "'"));
  }
  std::ofstream(path) << "10 drop\n9 drop\n";
  EXPECT_THAT(read_fault_script(path).error().message, HasSubstr("script:2: frame 9 comes after frame 10"));
}

TEST_F(OpenNi2Faults, AWrongScriptRefusesTheDeviceAndSaysWhere) {
  plug_in(2);
  script("0 nonsense\n");
  const auto source = open_openni2("", {});
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error().message, HasSubstr("recording.faults:1: got '0 nonsense'"));
}

TEST_F(OpenNi2Faults, AStallIsTimeOutsThenTheStreamGoesOnAndWhatWasLostIsCounted) {
  plug_in(20);
  play_on_its_own();
  script("5 stall 0.4\n");
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  int timeouts = 0;
  std::int64_t good = 0;
  while (good < 12) {
    const FrameOutcome outcome = source->next(frame, milliseconds(100));
    ASSERT_TRUE(outcome == FrameOutcome::ok || outcome == FrameOutcome::timeout) << source->last_problem();
    outcome == FrameOutcome::ok ? ++good : ++timeouts;
  }
  EXPECT_GE(timeouts, 2);
  EXPECT_GE(source->dropped(), 8) << "0.4 s at 30 frames a second";
  EXPECT_EQ(good + source->dropped(), frame.index + 1) << "every frame is there or counted";
}

TEST_F(OpenNi2Faults, ABurstAndDropsAreCountedToTheFrame) {
  plug_in(20);
  play_on_its_own("3");
  script("3 burst 6\n15 drop 4\n30 drop\n");
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  std::int64_t good = 0;
  std::int64_t first = -1;
  while (frame.index < 40) {
    const FrameOutcome outcome = source->next(frame, milliseconds(1000));
    ASSERT_EQ(outcome, FrameOutcome::ok) << source->last_problem();
    if (first < 0) first = frame.index;
    ++good;
  }
  EXPECT_GE(source->dropped(), 5);
  EXPECT_EQ(first, 0);
  EXPECT_EQ(good + source->dropped(), frame.index + 1);
}

TEST_F(OpenNi2Faults, OneTimestampThatGoesBackIsOneCorruptFrame) {
  plug_in(8);
  script("3 time -0.5\n");
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  for (std::int64_t i = 0; i < 6; ++i) {
    const FrameOutcome outcome = source->next(frame, kLong);
    EXPECT_EQ(frame.index, i);
    EXPECT_EQ(outcome, i == 3 ? FrameOutcome::corrupt : FrameOutcome::ok) << i;
    if (outcome == FrameOutcome::corrupt) {
      EXPECT_THAT(source->last_problem(), HasSubstr("virtual:0: frame 3: timestamp_s went back from "));
      EXPECT_EQ(frame.pixels, nullptr);
    } else {
      EXPECT_EQ(frame.timestamp_s, images_[static_cast<std::size_t>(i)].timestamp_s) << "the device's own";
    }
    allow_next();
  }
}

TEST_F(OpenNi2Faults, AClockThatIsSetBackCostsOneFrameAndTimeGoesOn) {
  plug_in(8);
  script("3 clock -1000\n");
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  double last_s = 0.0;
  for (std::int64_t i = 0; i < 8; ++i) {
    EXPECT_EQ(source->next(frame, kLong), i == 3 ? FrameOutcome::corrupt : FrameOutcome::ok) << i;
    if (i != 3) {
      EXPECT_GT(frame.timestamp_s, last_s);
      last_s = frame.timestamp_s;
    }
    allow_next();
  }
  EXPECT_LT(last_s - images_[0].timestamp_s, 60.0);
}

TEST_F(OpenNi2Faults, AClockThatStandsStillForGoodCostsThreeFramesThenTheHostsIsUsedAndSaidOnce) {
  plug_in(12);
  script("3 still\n");
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  double last_s = 0.0;
  std::vector<std::string> notes;
  for (std::int64_t i = 0; i < 12; ++i) {
    const bool still = i >= 3 && i < 6;
    EXPECT_EQ(source->next(frame, kLong), still ? FrameOutcome::corrupt : FrameOutcome::ok) << i;
    if (auto note = source->take_note(); !note.empty()) notes.push_back(note);
    if (!still) {
      EXPECT_GT(frame.timestamp_s, last_s) << i;
      last_s = frame.timestamp_s;
    }
    allow_next();
  }
  EXPECT_LT(last_s - images_[0].timestamp_s, 60.0);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], testing::MatchesRegex("virtual:0: the device's clock stands still at [0-9.]+ s; "
                                              "from frame 6 on the host's is used"));
}

TEST_F(OpenNi2Faults, AClockThatGoesOnAfterTwoFramesIsBelievedAgain) {
  plug_in(7);
  script("3 still 2\n");
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  for (std::int64_t i = 0; i < 7; ++i) {
    const bool still = i == 3 || i == 4;
    EXPECT_EQ(source->next(frame, kLong), still ? FrameOutcome::corrupt : FrameOutcome::ok) << i;
    if (!still) {
      EXPECT_EQ(frame.timestamp_s, images_[static_cast<std::size_t>(i)].timestamp_s) << i;
    }
    allow_next();
  }
  EXPECT_EQ(source->take_note(), "");
}

TEST_F(OpenNi2Faults, AFrameWithRowsMissingIsCorruptAndTheNextIsGood) {
  plug_in(4);
  script("1 cut\n");
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  for (std::int64_t i = 0; i < 4; ++i) {
    EXPECT_EQ(source->next(frame, kLong), i == 1 ? FrameOutcome::corrupt : FrameOutcome::ok) << i;
    if (i == 1) {
      EXPECT_THAT(source->last_problem(), HasSubstr("frame 1: 40x15 in 1200 bytes instead of 40x30"));
    }
    allow_next();
  }
}

TEST_F(OpenNi2Faults, AnUnpluggedDeviceIsLostWithinASecondAndComesBackThreeTimes) {
  plug_in(10);
  play_on_its_own("2");
  script("10 unplug 0.2\n20 unplug 0.05\n30 unplug 0.4\n");
  const auto source = open_reconnecting();
  ASSERT_TRUE(source);
  const Seen seen = watch(*source, 50);
  EXPECT_EQ(seen.losses, 3);
  expect_rising(seen);
  EXPECT_EQ(static_cast<std::int64_t>(seen.good.size()) + source->dropped(), seen.good.back() + 1);
}

TEST_F(OpenNi2Faults, AProgramOrdersFaultsByInvoke) {
  plug_in(10);
  play_on_its_own("2");
  const auto source = open_reconnecting();
  ASSERT_TRUE(source);
  watch(*source, 5);
  openni::Device device;
  ASSERT_EQ(device.open("virtual:0"), openni::STATUS_OK);
  const auto order = [&device](FaultKind kind, std::int32_t value) {
    ASSERT_TRUE(device.isCommandSupported(fault_command(kind)));
    ASSERT_EQ(device.invoke(fault_command(kind), value), openni::STATUS_OK);
  };
  EXPECT_FALSE(device.isCommandSupported(kFirstFaultCommand - 1));
  order(FaultKind::time, -500);
  EXPECT_EQ(watch(*source, 5).corrupt.size(), 1U);
  const auto before = source->dropped();
  order(FaultKind::drop, 7);
  watch(*source, 5);
  EXPECT_GE(source->dropped(), before + 7);
  DepthFrame frame;
  order(FaultKind::unplug, -1);
  const auto pulled = steady_clock::now();
  while (source->next(frame, milliseconds(50)) != FrameOutcome::device_lost) {
    ASSERT_LT(steady_clock::now() - pulled, milliseconds(1000));
  }
  for (int i = 0; i < 10; ++i) EXPECT_EQ(source->next(frame, milliseconds(20)), FrameOutcome::timeout);
  EXPECT_THAT(source->last_problem(), HasSubstr("virtual:0: can't open the OpenNI2 device: "));
  order(FaultKind::replug, 0);
  EXPECT_EQ(watch(*source, 5).losses, 0);
}

TEST_F(OpenNi2Faults, ADeviceThatFallsSilentIsOpenedAgain) {
  plug_in(10);
  play_on_its_own("2");
  script("5 stall 1000\n");
  ReconnectOptions reconnect;
  reconnect.first_wait = milliseconds(20);
  reconnect.silence = milliseconds(300);
  auto source = open_openni2_reconnecting("", {}, reconnect);
  ASSERT_TRUE(source) << source.error().message;
  const Seen seen = watch(**source, 10);
  EXPECT_EQ(seen.losses, 1);
  expect_rising(seen);
}

TEST_F(OpenNi2Faults, ClosingEndsInTheMiddleOfAStallAnUnpluggingOrADriverThatHangs) {
  plug_in(10);
  play_on_its_own("5");
  for (const char* faults : {"3 stall 1000\n", "3 unplug\n", "3 unplug 0.01\n", "3 hang 0.3\n", "3 burst 1000000\n"}) {
    script(faults);
    for (int round = 0; round < 4; ++round) {
      auto source = open_reconnecting();
      ASSERT_TRUE(source);
      DepthFrame frame;
      const auto until = steady_clock::now() + milliseconds(30 + 15 * round);
      while (steady_clock::now() < until) source->next(frame, milliseconds(5));
      const auto closing = steady_clock::now();
      source.reset();
      EXPECT_LT(steady_clock::now() - closing, milliseconds(2000)) << faults;
    }
  }
}

}  // namespace
}  // namespace tubetrack
