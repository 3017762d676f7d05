// What goes wrong with a live device, seen from the program: losses, kills, damaged files; and that a live run gives
// what a replay of the same frames gives.
#include <gmock/gmock.h>

#include <set>
#include <utility>

#include "apps/live_device.hpp"
#include "tubetrack/replay/recorder.hpp"

namespace tubetrack {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::count_lines;
using test::kFrames;
using test::kPoll;
using test::read_file;
using test::read_lines;
using testing::HasSubstr;

class LiveFaults : public test::LiveTest {
 protected:
  /// The recording's frames `interval_s` apart, so that a slow machine has time for each.
  fs::path slowed(double interval_s) const {
    fs::path slow = folder_ / "slow";
    auto recording = open_recording(recording_, {});
    auto recorder = Recorder::create(slow, recording->source->info());
    EXPECT_TRUE(recorder);
    DepthFrame frame;
    while (recording->source->next(frame, std::chrono::seconds(60)) == FrameOutcome::ok) {
      frame.timestamp_s = 100.0 + interval_s * static_cast<double>(frame.index);
      EXPECT_TRUE(recorder->write(frame));
    }
    return slow;
  }

  /// Starts a recording of a device that plays on its own, and kills it once it has some frames.
  void record_and_kill(const fs::path& path, const fs::path& sign_of_life, int lines_of_life) {
    const pid_t pid = start({"record", path, "--quiet"}, folder_);
    const auto alive = [&] {
      return lines_of_life == 0 ? fs::exists(sign_of_life) : count_lines(sign_of_life) > lines_of_life;
    };
    while (!alive() && waitpid(pid, nullptr, WNOHANG) == 0) std::this_thread::sleep_for(kPoll);
    kill(pid, SIGKILL);
    EXPECT_EQ(wait(pid), 1000 + SIGKILL) << errors();
  }

  fs::path record_oni() {
    const fs::path path = folder_ / "desk.oni";
    play_on_its_own("0.5");
    EXPECT_EQ(run({"record", path, "--frames", "0:4"}), 0) << errors();
    return path;
  }
};

TEST_F(LiveFaults, AfterALossTheStreamGoesOnAndNoIdIsUsedTwice) {
  play_on_its_own("0.3", "3 unplug 0.3\n6 unplug 0.3\n");
  ASSERT_EQ(run({"live", "--frames", "0:9", "--out", lines()}), 0) << errors();
  EXPECT_THAT(errors(), HasSubstr("note: virtual:0: the device was unplugged; waiting for it to be back"));
  EXPECT_THAT(errors(), HasSubstr("note: virtual:0: is back; tracking starts anew"));
  EXPECT_THAT(errors(), HasSubstr(", lost 2 times for "));
  std::set<std::int64_t> ids;
  std::int64_t last_frame = -1;
  double last_s = -1.0;
  for (const json& line : read_lines(lines())) {
    EXPECT_GT(line["frame"], last_frame);
    EXPECT_GT(line["timestamp_s"], last_s);
    last_frame = line["frame"];
    last_s = line["timestamp_s"];
    for (const json& tube : line["tubes"]) ids.insert(tube["id"].get<std::int64_t>());
  }
  EXPECT_EQ(ids, (std::set<std::int64_t>{1, 2, 3}));
}

TEST_F(LiveFaults, WhatIsKeptOverALossHasItsIdAfterwards) {
  play_on_its_own("0.3", "3 unplug 0.3\n");
  ASSERT_EQ(run({"live", "--on-reconnect", "keep", "--frames", "0:6", "--out", lines()}), 0) << errors();
  EXPECT_THAT(errors(), HasSubstr("its map and tubes were kept"));
  for (const json& line : read_lines(lines())) {
    for (const json& tube : line["tubes"]) EXPECT_EQ(tube["id"], 1);
  }
}

TEST_F(LiveFaults, TheSummaryAndTheStatusLineTellLatencyJitterAndDrops) {
  play_on_its_own("0.3", "2 drop 2\n");
  ASSERT_EQ(run({"live", "--frames", "0:8", "--status-every", "0.2", "--out", lines()}), 0) << errors();
  EXPECT_THAT(errors(), HasSubstr(" by the device)"));
  EXPECT_GE(read_lines(lines()).back()["dropped"], 2);
  EXPECT_THAT(errors(), HasSubstr("  to result "));
  EXPECT_THAT(errors(), HasSubstr("  jitter "));
  EXPECT_THAT(errors(), HasSubstr("status: 0."));
  EXPECT_THAT(errors(), HasSubstr(" median "));
}

TEST_F(LiveFaults, ADeviceWhoseClockStandsStillIsFollowedByTheHostsClockAndANoteSaysSoOnce) {
  play_on_its_own("0.3", "3 still\n");
  ASSERT_EQ(run({"live", "--frames", "0:12", "--out", lines()}), 0) << errors();
  const std::string said = errors();
  const std::size_t at = said.find("note: virtual:0: the device's clock stands still at ");
  ASSERT_NE(at, std::string::npos) << said;
  EXPECT_EQ(said.find("stands still", at + 60), std::string::npos) << said;
  double last_s = -1.0;
  int corrupt = 0;
  for (const json& line : read_lines(lines())) {
    if (line["status"] == "corrupt") {
      ++corrupt;
      continue;
    }
    EXPECT_GT(line["timestamp_s"], last_s);
    last_s = line["timestamp_s"];
  }
  EXPECT_LE(corrupt, 3);
}

TEST_F(LiveFaults, CtrlCEndsARunWhoseDeviceIsAway) {
  play_on_its_own("1", "2 unplug\n");
  const pid_t pid = start({"live", "--out", lines()}, folder_);
  while (errors().find("waiting for it") == std::string::npos && waitpid(pid, nullptr, WNOHANG) == 0) {
    std::this_thread::sleep_for(kPoll);
  }
  kill(pid, SIGINT);
  EXPECT_EQ(wait(pid), 0) << errors();
}

TEST_F(LiveFaults, CtrlCEndsARunWhoseDriverDoesNotLetGo) {
  play_on_its_own("1", "2 hang 1000\n");
  const pid_t pid = start({"live", "--quiet", "--out", lines()}, folder_);
  while (count_lines(lines()) < 3 && waitpid(pid, nullptr, WNOHANG) == 0) std::this_thread::sleep_for(kPoll);
  kill(pid, SIGINT);
  EXPECT_EQ(wait(pid), 1);
  EXPECT_THAT(errors(), HasSubstr("the device's driver does not let go; ended all the same"));
  EXPECT_THAT(read_file(lines()), testing::EndsWith("\n"));
}

TEST_F(LiveFaults, LiveGivesTheTubesOfARealtimeReplay) {
  const fs::path slow = slowed(0.8);
  setenv("TUBETRACK_VIRTUAL_DEVICE", slow.c_str(), 1);
  unsetenv("TUBETRACK_VIRTUAL_LOCKSTEP");
  const fs::path replayed = folder_ / "replayed.jsonl";
  const pid_t replay =
      start({"replay", slow, "--pace", "realtime", "--no-timing", "--quiet", "--out", replayed}, root_);
  ASSERT_EQ(run({"live", "--frames", "0:3", "--no-timing", "--quiet", "--out", lines()}), 0) << errors();
  ASSERT_EQ(wait(replay), 0);
  EXPECT_EQ(count_lines(lines()), kFrames);
  EXPECT_EQ(read_file(lines()), read_file(replayed));
}

TEST_F(LiveFaults, AKilledRecordingReplaysUpToItsLastWholeFrame) {
  play_on_its_own("3");
  for (const int frames : {1, 4, 9}) {
    const fs::path path = folder_ / ("killed" + std::to_string(frames));
    record_and_kill(path, path / "depth.txt", frames);
    auto recording = open_recording(path, {});
    ASSERT_TRUE(recording) << recording.error().message;
    const std::int64_t listed = count_lines(path / "depth.txt") - 1;
    EXPECT_GE(listed, frames);
    EXPECT_EQ(recording->source->info().frame_count, listed);
    DepthFrame frame;
    for (std::int64_t i = 0; i < listed; ++i) {
      ASSERT_EQ(recording->source->next(frame, std::chrono::seconds(60)), FrameOutcome::ok)
          << recording->source->last_problem();
    }
  }
}

TEST_F(LiveFaults, AnOniIsRecordedReadBackAndReplayedAndAKilledOneIsRefusedInOneLine) {
  const fs::path path = record_oni();
  EXPECT_THAT(errors(), HasSubstr("desk.oni: read back: "));
  ASSERT_EQ(run({"replay", path, "--quiet", "--out", lines()}), 0) << errors();
  EXPECT_GE(count_lines(lines()), 4);
  const fs::path killed = folder_ / "killed.oni";
  record_and_kill(killed, killed, 0);
  EXPECT_EQ(run({"replay", killed, "--quiet"}), 1);
  EXPECT_THAT(errors(), HasSubstr("killed.oni: can't be read as .oni: it is "));
  const std::string said = errors();
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
}

TEST_F(LiveFaults, AnOniThatCrashesTheRuntimeIsRefusedInOneLine) {
  const std::string whole = read_file(record_oni());
  const fs::path damaged = folder_ / "damaged.oni";
  int crashed = 0;
  // Sizes of records before the first frame: each of these took a run down that decoded by itself.
  for (const auto& [at, value] : {std::pair(0x3ca, 144), std::pair(0x2b4, 222), std::pair(0x191, 252)}) {
    std::string bytes = whole;
    bytes[static_cast<std::size_t>(at)] = static_cast<char>(value);
    std::ofstream(damaged, std::ios::binary | std::ios::trunc) << bytes;
    const int exit_code = run({"replay", damaged, "--quiet", "--out", lines()});
    EXPECT_LE(exit_code, 1) << errors();
    const std::string said = errors();
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), exit_code) << said;
    if (said.find("the OpenNI2 runtime crashed opening it") != std::string::npos) ++crashed;
  }
  EXPECT_GE(crashed, 1) << "or these bytes show nothing";
}

TEST_F(LiveFaults, ADamagedOniDoesNotHangTheProgram) {
  const fs::path path = record_oni();
  const std::string whole = read_file(path);
  const std::size_t size = whole.find_last_not_of('\0');
  for (const int i : {1, 3, 6}) {
    std::string bytes = whole;
    const std::size_t at = size * static_cast<std::size_t>(i) / 7;
    for (std::size_t k = at; k < at + 40; ++k) bytes[k] = static_cast<char>(~bytes[k]);
    const fs::path damaged = folder_ / "damaged.oni";
    std::ofstream(damaged, std::ios::binary | std::ios::trunc) << bytes;
    const auto started = std::chrono::steady_clock::now();
    run({"replay", damaged, "--quiet", "--out", lines()});
    EXPECT_LT(std::chrono::steady_clock::now() - started, std::chrono::seconds(20)) << i;
  }
}

}  // namespace
}  // namespace tubetrack
