#include <gmock/gmock.h>

#include <algorithm>

#include "recording_files.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(ImageFolder, PngTiffAndPgmComeInNaturalOrderAtThirtyFramesASecond) {
  const TemporaryFolder folder;
  write_depth(folder / "frame_10.png", 16, 12, 10);
  write_depth(folder / "frame_9.tiff", 16, 12, 9);
  write_depth(folder / "frame_2.pgm", 16, 12, 2);
  write_depth(folder / "frame_11.TIF", 16, 12, 11);
  write_text(folder / "README.md", "not a frame");
  auto opened = open_recording(folder.path(), flags());
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_THAT(opened->notes, ElementsAre(AllOf(HasSubstr("no timestamps, 30 frames a second of one scene assumed"),
                                               HasSubstr("one by one"))));
  const auto seen = play(*opened->source);
  ASSERT_EQ(seen.size(), 4u);
  const int seeds[] = {2, 9, 10, 11};
  for (std::size_t i = 0; i < 4; ++i) {
    ASSERT_EQ(seen[i].outcome, FrameOutcome::ok) << seen[i].problem;
    EXPECT_EQ(seen[i].frame.index, static_cast<std::int64_t>(i));
    EXPECT_DOUBLE_EQ(seen[i].frame.timestamp_s, static_cast<double>(i) / 30.0);
    const auto expected = slanted_depths(16, 12, seeds[i]);
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), seen[i].frame.pixels));
  }
}

TEST(ImageFolder, ASingleImageIsARecordingOfOneFrame) {
  const TemporaryFolder folder;
  write_depth(folder / "one.png", 16, 12, 0);
  write_depth(folder / "two.png", 16, 12, 1);
  auto opened = open_recording(folder / "one.png", flags());
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_THAT(opened->notes, IsEmpty());
  EXPECT_EQ(opened->source->info().frame_count, 1);
  EXPECT_EQ(play(*opened->source).size(), 1u);
}

TEST(ImageFolder, CameraInfoInTheFolderSavesTheFlags) {
  const TemporaryFolder folder;
  write_depth(folder / "one.png", 16, 12, 0);
  write_text(folder / "camera_info.yaml", camera_info_text(16, 12));
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().intrinsics.fx_px, 500.0);
  EXPECT_EQ(opened->source->info().metres_per_unit, 0.001);
}

TEST(ImageFolder, WithoutIntrinsicsTheErrorShowsTheFlag) {
  const TemporaryFolder folder;
  write_depth(folder / "one.png", 16, 12, 0);
  RecordingOptions options;
  options.metres_per_unit = 0.001;
  const Error error = error_of(folder.path(), options);
  EXPECT_EQ(error.kind, Error::Kind::usage);
  EXPECT_THAT(error.message, AllOf(HasSubstr(folder.path().string()), HasSubstr("--intrinsics 525,525,319.5,239.5")));
}

TEST(ImageFolder, MillimetresAreNotAssumed) {
  const TemporaryFolder folder;
  write_depth(folder / "one.png", 16, 12, 0, 5000);
  RecordingOptions options = flags();
  options.metres_per_unit.reset();
  auto opened = open_recording(folder.path(), options);
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().metres_per_unit, 1.0 / 5000.0);
  EXPECT_THAT(opened->notes, ElementsAre(AllOf(HasSubstr("1/5000"), HasSubstr("--depth-scale"))));
}

TEST(ImageFolder, AFolderThatIsNotThereIsAWrongArgument) {
  const TemporaryFolder folder;
  const Error error = error_of(folder / "nowhere", flags());
  EXPECT_EQ(error.kind, Error::Kind::usage);
  EXPECT_THAT(error.message, AllOf(HasSubstr("nowhere: no such file or folder"), HasSubstr("give the folder")));
}

TEST(ImageFolder, AFolderWithoutImagesSaysWhatItTakes) {
  const TemporaryFolder folder;
  Error error = error_of(folder.path(), flags());
  EXPECT_EQ(error.kind, Error::Kind::failed);
  EXPECT_THAT(error.message, AllOf(HasSubstr("no frames in this folder"), HasSubstr("depth.txt"), HasSubstr(".png")));
  write_depth(folder / "depth/1.png", 16, 12, 0);
  error = error_of(folder.path(), flags());
  EXPECT_THAT(error.message, HasSubstr("its images are in " + (folder / "depth").string()));
}

TEST(ImageFolder, AnUnknownFileSaysWhatItTakes) {
  const TemporaryFolder folder;
  write_text(folder / "film.avi", "x");
  const Error error = error_of(folder / "film.avi", flags());
  EXPECT_EQ(error.kind, Error::Kind::usage);
  EXPECT_THAT(error.message, AllOf(HasSubstr("film.avi: no recording"), HasSubstr("depth.txt")));
}

TEST(ImageFolder, ATruncatedTiffOrPgmIsACorruptFrame) {
  const TemporaryFolder folder;
  for (const char* name : {"1.png", "2.png", "3.tiff", "4.pgm", "5.png"}) write_depth(folder / name, 64, 48, 0);
  truncate_to_half(folder / "3.tiff");
  truncate_to_half(folder / "4.pgm");
  auto opened = open_recording(folder.path(), flags());
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  const auto seen = play(*opened->source);
  ASSERT_EQ(seen.size(), 5u);
  EXPECT_EQ(seen[2].outcome, FrameOutcome::corrupt);
  EXPECT_THAT(seen[2].problem, HasSubstr("3.tiff: cannot be decoded"));
  EXPECT_EQ(seen[3].outcome, FrameOutcome::corrupt);
  EXPECT_THAT(seen[3].problem, HasSubstr("4.pgm: cannot be decoded"));
  EXPECT_EQ(seen[4].outcome, FrameOutcome::ok);
}

}  // namespace
}  // namespace tubetrack
