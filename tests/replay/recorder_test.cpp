#include "tubetrack/replay/recorder.hpp"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <random>

#include "recording_files.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

StreamInfo stream_info(int width, int height) {
  StreamInfo info;
  info.name = "test";
  info.intrinsics = intrinsics_from_field_of_view(width, height, 1.0, 0.8);
  info.intrinsics.distortion = {0.01, -0.02, 1e-4, 2e-4, 0.003, 0.0, 0.0, 0.0};
  info.metres_per_unit = 0.0001;
  return info;
}

DepthFrame frame_of(const std::vector<std::uint16_t>& pixels, int width, int height, double timestamp_s) {
  DepthFrame frame;
  frame.pixels = pixels.data();
  frame.width = width;
  frame.height = height;
  frame.stride_bytes = static_cast<std::size_t>(width) * sizeof(std::uint16_t);
  frame.metres_per_unit = 0.0001;
  frame.timestamp_s = timestamp_s;
  return frame;
}

/// All 65536 values and noise: nothing a codec could round without being seen. The median lies between 0.2 and 10 m.
std::vector<std::uint16_t> any_pixels(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint16_t> pixels(static_cast<std::size_t>(width * height));
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = static_cast<std::uint16_t>(i < 65536 ? i : random());
  }
  return pixels;
}

TEST(Recorder, WhatIsWrittenIsReadBackBitForBit) {
  const TemporaryFolder folder;
  constexpr int width = 321;
  constexpr int height = 240;
  const StreamInfo info = stream_info(width, height);
  std::vector<std::vector<std::uint16_t>> pixels;
  const double stamps[] = {1700000000.1234567, 1700000000.1567891, 1700000000.19};
  auto recorder = Recorder::create(folder / "a/b", info);
  ASSERT_TRUE(recorder.has_value()) << recorder.error().message;
  std::vector<Eigen::Isometry3d> poses;
  for (unsigned i = 0; i < 3; ++i) {
    pixels.push_back(any_pixels(width, height, i));
    DepthFrame frame = frame_of(pixels.back(), width, height, stamps[i]);
    poses.push_back(Eigen::Translation3d(0.1 * i, 1.0 / 3.0, -2.0) *
                    Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d(1, 2, 3).normalized()));
    frame.world_from_camera = poses.back();
    const auto written = recorder->write(frame);
    ASSERT_TRUE(written.has_value()) << written.error().message;
  }
  EXPECT_EQ(recorder->frames_written(), 3);
  auto opened = open_recording(folder / "a/b", {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_THAT(opened->notes, IsEmpty());
  EXPECT_EQ(opened->source->info().intrinsics.fx_px, info.intrinsics.fx_px);
  EXPECT_EQ(opened->source->info().intrinsics.fy_px, info.intrinsics.fy_px);
  EXPECT_EQ(opened->source->info().intrinsics.distortion, info.intrinsics.distortion);
  EXPECT_EQ(opened->source->info().metres_per_unit, info.metres_per_unit);
  const auto seen = play(*opened->source);
  ASSERT_EQ(seen.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_EQ(seen[i].outcome, FrameOutcome::ok) << seen[i].problem;
    EXPECT_EQ(seen[i].frame.timestamp_s, stamps[i]);
    for (int v = 0; v < height; ++v) {
      ASSERT_TRUE(std::equal(seen[i].frame.row(v), seen[i].frame.row(v) + width, pixels[i].begin() + v * width));
    }
    EXPECT_TRUE(pose_or_nan(seen[i].frame.world_from_camera).isApprox(poses[i], 1e-14));
  }
}

TEST(Recorder, ARowStrideLongerThanTheRowIsHonoured) {
  const TemporaryFolder folder;
  const std::vector<std::uint16_t> wide = slanted_depths(20, 12, 0, 9000);
  DepthFrame frame = frame_of(wide, 16, 12, 1.0);
  frame.stride_bytes = 20 * sizeof(std::uint16_t);
  auto recorder = Recorder::create(folder.path(), stream_info(16, 12));
  ASSERT_TRUE(recorder.has_value()) << recorder.error().message;
  ASSERT_TRUE(recorder->write(frame).has_value());
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  const auto seen = play(*opened->source);
  ASSERT_EQ(seen.size(), 1u);
  for (int v = 0; v < 12; ++v) {
    EXPECT_TRUE(std::equal(seen[0].frame.row(v), seen[0].frame.row(v) + 16, wide.begin() + v * 20));
  }
}

TEST(Recorder, TheFolderIsAReadableRecordingAfterEveryFrame) {
  const TemporaryFolder folder;
  const auto pixels = slanted_depths(16, 12, 0, 9000);
  auto recorder = Recorder::create(folder.path(), stream_info(16, 12));
  ASSERT_TRUE(recorder.has_value()) << recorder.error().message;
  EXPECT_THAT(error_of(folder.path()).message, HasSubstr("no frames in it"));
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(recorder->write(frame_of(pixels, 16, 12, i)).has_value());
    auto opened = open_recording(folder.path(), {});
    ASSERT_TRUE(opened.has_value()) << opened.error().message;
    EXPECT_EQ(play(*opened->source).size(), static_cast<std::size_t>(i) + 1);
  }
}

TEST(Recorder, KilledItLeavesAReadableRecording) {
  const TemporaryFolder folder;
  int written[2];
  ASSERT_EQ(::pipe(written), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto recorder = Recorder::create(folder.path(), stream_info(320, 240));
    const auto pixels = slanted_depths(320, 240, 0, 9000);
    DepthFrame frame = frame_of(pixels, 320, 240, 0.0);
    frame.world_from_camera = Eigen::Isometry3d::Identity();
    while (recorder && recorder->write(frame)) {
      frame.timestamp_s += 0.1;
      if (::write(written[1], "x", 1) != 1) break;
    }
    ::_exit(1);
  }
  ::close(written[1]);
  char byte = 0;
  for (int i = 0; i < 7; ++i) ASSERT_EQ(::read(written[0], &byte, 1), 1);
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  ::close(written[0]);
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  const auto seen = play(*opened->source);
  EXPECT_GE(seen.size(), 7u);
  for (const SeenFrame& one : seen) {
    EXPECT_EQ(one.outcome, FrameOutcome::ok) << one.problem;
    EXPECT_TRUE(one.frame.world_from_camera.has_value());
  }
}

TEST(Recorder, AFolderThatIsNotOursIsLeftAlone) {
  const TemporaryFolder folder;
  write_text(folder / "thesis.tex", "years of work");
  auto recorder = Recorder::create(folder.path(), stream_info(16, 12));
  ASSERT_FALSE(recorder.has_value());
  EXPECT_EQ(recorder.error().kind, Error::Kind::usage);
  EXPECT_THAT(recorder.error().message,
              HasSubstr("is not empty and no recording of tubetrack; give a new or empty folder"));
  // Somebody else's TUM recording is not ours either.
  write_tum(folder / "tum", 1);
  EXPECT_FALSE(Recorder::create(folder / "tum", stream_info(16, 12)).has_value());
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / "tum/depth"), {}), 1);
  recorder = Recorder::create(folder / "thesis.tex", stream_info(16, 12));
  ASSERT_FALSE(recorder.has_value());
  EXPECT_THAT(recorder.error().message, HasSubstr("thesis.tex: is a file"));
}

TEST(Recorder, AnEarlierRecordingOfOursIsReplacedAndNothingElse) {
  const TemporaryFolder folder;
  const auto pixels = slanted_depths(16, 12, 0, 9000);
  for (const int count : {3, 1}) {
    auto recorder = Recorder::create(folder.path(), stream_info(16, 12));
    ASSERT_TRUE(recorder.has_value()) << recorder.error().message;
    DepthFrame frame = frame_of(pixels, 16, 12, 0.0);
    if (count == 3) frame.world_from_camera = Eigen::Isometry3d::Identity();
    for (int i = 0; i < count; ++i) ASSERT_TRUE(recorder->write(frame).has_value());
    write_text(folder / "notes.txt", "mine");
    write_text(folder / "depth/notes.txt", "mine");
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "notes.txt"));
  EXPECT_TRUE(std::filesystem::exists(folder / "depth/notes.txt"));
  EXPECT_FALSE(std::filesystem::exists(folder / "groundtruth.txt"));
  EXPECT_FALSE(std::filesystem::exists(folder / "depth/000001.png"));
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().frame_count, 1);
}

TEST(Recorder, AFrameOfAnotherSizeOrUnitIsRefused) {
  const TemporaryFolder folder;
  const auto pixels = slanted_depths(16, 12, 0, 9000);
  auto recorder = Recorder::create(folder.path(), stream_info(16, 12));
  ASSERT_TRUE(recorder.has_value()) << recorder.error().message;
  auto written = recorder->write(frame_of(pixels, 12, 16, 0.0));
  ASSERT_FALSE(written.has_value());
  EXPECT_THAT(written.error().message, HasSubstr("got 12 x 16 pixels of 0.0001 m, takes 16 x 12 of 0.0001 m"));
  DepthFrame frame = frame_of(pixels, 16, 12, 0.0);
  frame.metres_per_unit = 0.001;
  written = recorder->write(frame);
  ASSERT_FALSE(written.has_value());
  EXPECT_EQ(recorder->frames_written(), 0);
}

TEST(Recorder, AFrameThatCannotBeWrittenIsNamedAndTheOnesBeforeStay) {
  const TemporaryFolder folder;
  const auto pixels = slanted_depths(16, 12, 0, 9000);
  auto recorder = Recorder::create(folder.path(), stream_info(16, 12));
  ASSERT_TRUE(recorder.has_value()) << recorder.error().message;
  ASSERT_TRUE(recorder->write(frame_of(pixels, 16, 12, 0.0)).has_value());
  std::filesystem::rename(folder / "depth", folder / "elsewhere");
  const auto written = recorder->write(frame_of(pixels, 16, 12, 0.1));
  ASSERT_FALSE(written.has_value());
  EXPECT_EQ(written.error().kind, Error::Kind::failed);
  EXPECT_THAT(written.error().message, HasSubstr("depth/000001.png: cannot be written: No such file or directory"));
  std::filesystem::rename(folder / "elsewhere", folder / "depth");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(play(*opened->source).size(), 1u);
}

}  // namespace
}  // namespace tubetrack
