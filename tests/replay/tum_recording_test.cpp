#include <gmock/gmock.h>

#include "recording_files.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<FrameOutcome> outcomes(const std::vector<SeenFrame>& seen) {
  std::vector<FrameOutcome> result;
  result.reserve(seen.size());
  for (const SeenFrame& one : seen) result.push_back(one.outcome);
  return result;
}

constexpr auto ok = FrameOutcome::ok;
constexpr auto corrupt = FrameOutcome::corrupt;

TEST(TumRecording, GivesEveryFrameWithItsPixelsStampAndPlace) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 3);
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_THAT(opened->notes, IsEmpty());
  const StreamInfo& info = opened->source->info();
  EXPECT_EQ(info.intrinsics.width, 16);
  EXPECT_EQ(info.intrinsics.height, 12);
  EXPECT_EQ(info.intrinsics.fx_px, 500.0);
  EXPECT_EQ(info.intrinsics.fy_px, 501.0);
  EXPECT_EQ(info.intrinsics.cx_px, 7.5);
  EXPECT_EQ(info.intrinsics.cy_px, 5.5);
  EXPECT_EQ(info.metres_per_unit, 0.001);
  EXPECT_FALSE(info.has_poses);
  EXPECT_EQ(info.frame_count, 3);
  const auto seen = play(*opened->source);
  ASSERT_THAT(outcomes(seen), ElementsAre(ok, ok, ok));
  for (int i = 0; i < 3; ++i) {
    const DepthFrame& frame = seen[static_cast<std::size_t>(i)].frame;
    EXPECT_EQ(frame.index, i);
    EXPECT_NEAR(frame.timestamp_s, 10.0 + 0.1 * i, 1e-12);
    EXPECT_FALSE(frame.pose_missing);
    const auto expected = slanted_depths(16, 12, i);
    for (int v = 0; v < 12; ++v) {
      EXPECT_TRUE(std::equal(frame.row(v), frame.row(v) + 16, expected.begin() + 16 * v));
    }
  }
}

TEST(TumRecording, FramesOutliveTheSource) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 2);
  DepthFrame frame;
  {
    auto opened = open_recording(folder.path(), {});
    ASSERT_TRUE(opened.has_value()) << opened.error().message;
    ASSERT_EQ(opened->source->next(frame, {}), ok);
    DepthFrame another;
    ASSERT_EQ(opened->source->next(another, {}), ok);
  }
  EXPECT_EQ(frame.row(11)[15], slanted_depths(16, 12, 0).back());
}

TEST(TumRecording, TimeGoingBackIsOneCorruptFrameAndTheRunGoesOn) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 5);
  write_text(folder / "depth.txt",
             "10.0 depth/000000.png\n10.1 depth/000001.png\n3.5 depth/000002.png\n3.6 depth/000003.png\n"
             "10.4 depth/000004.png\n");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  const auto seen = play(*opened->source);
  ASSERT_THAT(outcomes(seen), ElementsAre(ok, ok, corrupt, ok, ok));
  EXPECT_THAT(seen[2].problem, HasSubstr("depth.txt:3: timestamp 3.5 goes back (the line before has 10.1)"));
  EXPECT_EQ(seen[2].frame.index, 2);
  EXPECT_EQ(seen[2].frame.timestamp_s, 3.5);
  EXPECT_EQ(seen[2].frame.pixels, nullptr);
  EXPECT_EQ(seen[3].problem, "");
}

TEST(TumRecording, ABadImageIsOneCorruptFrameAndTheRunGoesOn) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 11);
  truncate_to_half(folder / "depth/000002.png");
  std::filesystem::remove(folder / "depth/000003.png");
  write_8bit(folder / "depth/000004.png", 16, 12, 1);
  write_8bit(folder / "depth/000005.png", 16, 12, 3);
  write_depth(folder / "depth/000006.png", 12, 16, 0);
  write_text(folder / "depth/000007.png", "");
  write_text(folder / "depth/000009.png", "this is no image");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  const auto seen = play(*opened->source);
  ASSERT_THAT(outcomes(seen),
              ElementsAre(ok, ok, corrupt, corrupt, corrupt, corrupt, corrupt, corrupt, ok, corrupt, ok));
  EXPECT_THAT(seen[2].problem, HasSubstr("depth/000002.png: truncated PNG (ends after "));
  EXPECT_THAT(seen[3].problem, HasSubstr("depth/000003.png: cannot be opened: No such file"));
  EXPECT_THAT(seen[4].problem, HasSubstr("depth/000004.png: 8-bit with 1 channel(s), takes 16-bit with 1 channel"));
  EXPECT_THAT(seen[5].problem, HasSubstr("depth/000005.png: 8-bit with 3 channel(s), takes 16-bit with 1 channel"));
  EXPECT_THAT(seen[6].problem, HasSubstr("depth/000006.png: size 12 x 16, takes 16 x 12"));
  EXPECT_THAT(seen[7].problem, HasSubstr("depth/000007.png: is empty (0 bytes)"));
  EXPECT_THAT(seen[9].problem, HasSubstr("depth/000009.png: cannot be decoded"));
  for (const SeenFrame& one : seen) {
    EXPECT_EQ(one.problem.find('\n'), std::string::npos);
    EXPECT_EQ(one.frame.pixels == nullptr, one.outcome == corrupt);
  }
}

TEST(TumRecording, WithoutAnyReadableImageTheSizeComesFromCameraInfo) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 2);
  truncate_to_half(folder / "depth/000000.png");
  truncate_to_half(folder / "depth/000001.png");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().intrinsics.width, 16);
  EXPECT_THAT(outcomes(play(*opened->source)), ElementsAre(corrupt, corrupt));
  std::filesystem::remove(folder / "camera_info.yaml");
  const Error error = error_of(folder.path(), flags());
  EXPECT_EQ(error.kind, Error::Kind::failed);
  EXPECT_THAT(error.message, HasSubstr("none of its 2 image(s) can be read (first: "));
}

TEST(TumRecording, AFirstImageThatIsTruncatedDoesNotStopTheRun) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 3);
  truncate_to_half(folder / "depth/000000.png");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_THAT(outcomes(play(*opened->source)), ElementsAre(corrupt, ok, ok));
}

TEST(TumRecording, FramesNearAPoseHaveItAndOthersSayItIsMissing) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 3);
  write_text(folder / "groundtruth.txt", "10.0 0 0 0 0 0 0 1\n10.09 1 0 0 0 0 0 1\n10.11 2 0 0 0 0 0 1\n");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_TRUE(opened->source->info().has_poses);
  const auto seen = play(*opened->source);
  ASSERT_THAT(outcomes(seen), ElementsAre(ok, ok, ok));
  EXPECT_EQ(pose_or_nan(seen[0].frame.world_from_camera).translation(), Eigen::Vector3d::Zero());
  EXPECT_NEAR(pose_or_nan(seen[1].frame.world_from_camera).translation().x(), 1.5, 1e-9);
  EXPECT_FALSE(seen[2].frame.world_from_camera.has_value());
  EXPECT_TRUE(seen[2].frame.pose_missing);
  EXPECT_FALSE(seen[1].frame.pose_missing);
}

TEST(TumRecording, ABadLineInDepthTxtIsNamed) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 1);
  write_text(folder / "depth.txt", "10.0 depth/000000.png\nten depth/000000.png\n10.2 depth/000000.png\n");
  Error error = error_of(folder.path());
  EXPECT_EQ(error.kind, Error::Kind::failed);
  EXPECT_THAT(error.message, HasSubstr("depth.txt:2: got \"ten depth/000000.png\", takes: timestamp filename"));
  write_text(folder / "depth.txt", "# timestamp filename\n");
  error = error_of(folder.path());
  EXPECT_EQ(error.kind, Error::Kind::failed);
  EXPECT_THAT(error.message, HasSubstr("depth.txt: no frames in it"));
}

TEST(TumRecording, ALastLineCutShortIsLeftOutAndNoted) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 2);
  write_text(folder / "depth.txt", "10.0 depth/000000.png\n10.1");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().frame_count, 1);
  EXPECT_THAT(opened->notes, ElementsAre(HasSubstr("depth.txt:2: the last line is cut short")));
}

TEST(TumRecording, FileNamesMayHoldBlanks) {
  const TemporaryFolder folder;
  write_tum(folder.path(), 1);
  std::filesystem::rename(folder / "depth/000000.png", folder / "depth/my frame.png");
  write_text(folder / "depth.txt", "10.0 depth/my frame.png\n");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_THAT(outcomes(play(*opened->source)), ElementsAre(ok));
}

}  // namespace
}  // namespace tubetrack
