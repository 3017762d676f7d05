// `tubetrack live`, `record` and `devices` as a user runs them (live_device.hpp).
#include <gmock/gmock.h>

#include <atomic>

#include "apps/live_device.hpp"

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

class Live : public test::LiveTest {};

const std::string kAll = "0:" + std::to_string(kFrames);

TEST_F(Live, TheLinesAreReplaysByteForByte) {
  replay();
  // The recording brings its noise model, a device is known by its name.
  ASSERT_EQ(run({"live", "--noise", "synthetic", "--frames", kAll, "--no-timing", "--quiet", "--out", lines()}), 0)
      << errors();
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
  ASSERT_EQ(run({"live", "--frames", kAll, "--record", folder_ / "recorded", "--out", lines()}), 0) << errors();
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

TEST_F(Live, ALossThatIsToStopTheRunIsExitCode1AndTheFramesBeforeAreKept) {
  setenv("TUBETRACK_VIRTUAL_AT_END", "unplug", 1);
  EXPECT_EQ(run({"live", "--on-reconnect", "stop", "--quiet", "--out", lines()}), 1);
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
  EXPECT_THAT(errors(), HasSubstr("no OpenNI2 device found"));
}

TEST_F(Live, NothingIsRecordedOverWhatIsNoRecordingOrIsBeingPlayed) {
  const fs::path notes = folder_ / "notes.oni";
  std::ofstream(notes) << "what I saw\n";
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"record", notes}, {"live", "--record", notes}}) {
    EXPECT_EQ(run(arguments), 2);
    EXPECT_THAT(errors(), HasSubstr("notes.oni: is there, and no OpenNI2 recording; give another name"));
  }
  EXPECT_EQ(read_file(notes), "what I saw\n");
  EXPECT_EQ(run({"record", recording_}), 2);
  EXPECT_THAT(errors(), HasSubstr("is what the virtual device plays; give another name"));
  EXPECT_EQ(count_lines(recording_ / "truth.jsonl"), kFrames);
}

TEST_F(Live, WrongUseIsExitCode2InOneLineThatNamesTheFlag) {
  const auto refused = [this](std::vector<std::string> arguments) {
    EXPECT_EQ(run(arguments), 2) << errors();
    return errors();
  };
  EXPECT_THAT(refused({"record", folder_ / "nowhere" / "a.oni"}),
              HasSubstr("a.oni: No such file or directory; give a file"));
  EXPECT_THAT(refused({"live", "--record", folder_ / "nowhere" / "a.oni"}),
              HasSubstr("give a file in an existing folder"));
  EXPECT_EQ(refused({"live", "--deadline-ms", "5ms"}), "tubetrack: --deadline-ms 5ms: takes milliseconds, like 20\n");
  EXPECT_EQ(refused({"live", "--deadline-ms", "0"}),
            "tubetrack: --deadline-ms 0: got 0, takes milliseconds, 0.01 to 1000000\n");
  EXPECT_EQ(refused({"live", "--map", "plane"}),
            "tubetrack: --map: is a flag of replay alone; see tubetrack live --help\n");
  EXPECT_EQ(refused({"live", "--depth-scale", "0.001"}),
            "tubetrack: --depth-scale: a device says its own unit; leave it out\n");
  EXPECT_EQ(refused({"live", "--on-reconnect", "maybe"}),
            "tubetrack: --on-reconnect maybe: takes reset, keep or stop\n");
  EXPECT_THAT(refused({"live", "--mode", "640"}), HasSubstr("--mode 640: takes WIDTHxHEIGHT"));
  EXPECT_THAT(refused({"live", "--crop", "1,2,3"}), HasSubstr("--crop 1,2,3: takes u,v,w,h"));
  EXPECT_THAT(refused({"live", "--crop", "600,0,100,100"}),
              HasSubstr("virtual:0: crop 600,0,100,100: takes u,v,w,h within 640x480 pixels"));
  EXPECT_THAT(refused({"live", "--silence", "-1"}), HasSubstr("--silence -1: takes seconds"));
  EXPECT_THAT(refused({"live", "--status-every", "0"}), HasSubstr("--status-every 0: takes seconds above 0"));
  EXPECT_THAT(refused({"live", "--intrinsics", "0,570,319.5,239.5"}),
              HasSubstr("--intrinsics 0,570,319.5,239.5: takes"));
  EXPECT_THAT(refused({"record"}), HasSubstr("PATH"));
  EXPECT_THAT(refused({"record", "a", "b", "c"}), HasSubstr("see tubetrack record --help"));
}

}  // namespace
}  // namespace tubetrack
