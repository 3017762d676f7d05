#include <gmock/gmock.h>

#include <cmath>

#include "recording_files.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A TUM folder whose camera_info.yaml a test can spoil.
class RecordingOptionsTest : public ::testing::Test {
 protected:
  RecordingOptionsTest() { write_tum(folder.path(), 5); }
  void set_camera_info(const std::string& text) { write_text(folder / "camera_info.yaml", text); }
  Error expect_error(Error::Kind kind, const RecordingOptions& options = {}) {
    const Error error = error_of(folder.path(), options);
    EXPECT_NE(error.message, "");
    EXPECT_EQ(error.kind, kind) << error.message;
    return error;
  }

  TemporaryFolder folder;
};

TEST_F(RecordingOptionsTest, MissingIntrinsicsShowTheFlag) {
  std::filesystem::remove(folder / "camera_info.yaml");
  EXPECT_THAT(expect_error(Error::Kind::usage).message,
              AllOf(HasSubstr("intrinsics are missing"), HasSubstr("camera_info.yaml"),
                    HasSubstr("--intrinsics fx,fy,cx,cy"), HasSubstr("--intrinsics 525,525,319.5,239.5")));
}

TEST_F(RecordingOptionsTest, AFocalLengthThatCannotBeIsNamed) {
  for (const auto& [fx, got] :
       {std::pair{"0.0", "got 0,"}, {"-500", "got -500,"}, {".nan", "got nan,"}, {".inf", "got inf,"}}) {
    set_camera_info(camera_info_text(16, 12, fx));
    EXPECT_THAT(expect_error(Error::Kind::failed).message,
                AllOf(HasSubstr("camera_info.yaml: fx: "), HasSubstr(got), HasSubstr("--intrinsics")));
  }
}

TEST_F(RecordingOptionsTest, AFocalLengthInTheFlagThatCannotBeIsNamed) {
  RecordingOptions options = flags();
  for (const double focal : {0.0, -1.0, std::nan("")}) {
    options.intrinsics_px = {500.0, focal, 7.5, 5.5};
    EXPECT_THAT(expect_error(Error::Kind::usage, options).message,
                AllOf(HasSubstr("--intrinsics 500,"), HasSubstr("fy: got ")));
  }
}

TEST_F(RecordingOptionsTest, TheFlagRepairsABrokenFileAndSaysSo) {
  set_camera_info(camera_info_text(16, 12, "0.0"));
  auto opened = open_recording(folder.path(), flags());
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().intrinsics.fx_px, 500.0);
  EXPECT_THAT(opened->notes, ElementsAre(AllOf(HasSubstr("camera_info.yaml: says fx,fy,cx,cy = 0,501,7.5,5.5"),
                                               HasSubstr("--intrinsics 500,501,7.5,5.5"))));
}

TEST_F(RecordingOptionsTest, FlagsThatAgreeWithTheFileAreNotWorthANote) {
  auto opened = open_recording(folder.path(), flags());
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_THAT(opened->notes, IsEmpty());
}

TEST_F(RecordingOptionsTest, TheFlagDescribesACameraWithoutDistortion) {
  set_camera_info(camera_info_text(16, 12) + "distortion_coefficients: {data: [0.1, 0, 0, 0, 0]}\n");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().intrinsics.distortion[0], 0.1);
  opened = open_recording(folder.path(), flags());
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_FALSE(opened->source->info().intrinsics.has_distortion());
  EXPECT_THAT(opened->notes, ElementsAre(HasSubstr("with distortion")));
}

TEST_F(RecordingOptionsTest, CameraInfoOfAnotherSizeIsRefused) {
  set_camera_info(camera_info_text(640, 480));
  EXPECT_THAT(expect_error(Error::Kind::failed).message,
              AllOf(HasSubstr("camera_info.yaml: image_width x image_height is 640 x 480"),
                    HasSubstr("000000.png is 16 x 12"), HasSubstr("--intrinsics")));
  auto opened = open_recording(folder.path(), flags());
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().intrinsics.width, 16);
  EXPECT_THAT(opened->notes, ElementsAre(HasSubstr("640 x 480")));
}

TEST_F(RecordingOptionsTest, MixedSizesAreRefusedBeforeTheFirstFrame) {
  write_depth(folder / "depth/000004.png", 8, 6, 0);
  EXPECT_THAT(expect_error(Error::Kind::failed).message,
              AllOf(HasSubstr("mixed sizes"), HasSubstr("000000.png is 16 x 12"), HasSubstr("000004.png is 8 x 6")));
}

TEST_F(RecordingOptionsTest, AFirstImageThatIsNoDepthImageIsRefused) {
  write_8bit(folder / "depth/000000.png", 16, 12, 1);
  EXPECT_THAT(expect_error(Error::Kind::failed).message,
              HasSubstr("000000.png: 8-bit with 1 channel(s), takes 16-bit with 1 channel; export the raw depth"));
  write_8bit(folder / "depth/000000.png", 16, 12, 3);
  EXPECT_THAT(expect_error(Error::Kind::failed).message, HasSubstr("000000.png: 8-bit with 3 channel(s)"));
  // A damaged image in front of it tells nothing and does not hide it.
  write_8bit(folder / "depth/000001.png", 16, 12, 3);
  truncate_to_half(folder / "depth/000000.png");
  EXPECT_THAT(expect_error(Error::Kind::failed).message, HasSubstr("000001.png: 8-bit with 3 channel(s)"));
}

TEST_F(RecordingOptionsTest, WithoutAScaleTumsOwnIsAssumedAloud) {
  set_camera_info(camera_info_text(16, 12, "500.0", ""));
  for (int i = 0; i < 5; ++i) write_depth(folder / ("depth/00000" + std::to_string(i) + ".png"), 16, 12, i, 5000);
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().metres_per_unit, 1.0 / 5000.0);
  EXPECT_THAT(opened->notes, ElementsAre(AllOf(HasSubstr("1/5000"), HasSubstr("--depth-scale"))));
}

TEST_F(RecordingOptionsTest, MillimetresTakenForTumsScaleAreRefused) {
  set_camera_info(camera_info_text(16, 12, "500.0", ""));
  EXPECT_THAT(
      expect_error(Error::Kind::usage).message,
      AllOf(HasSubstr("median depth 0.18"), HasSubstr("TUM's 1/5000 assumed"), HasSubstr("--depth-scale 0.001")));
}

TEST_F(RecordingOptionsTest, AnAbsurdMedianDepthNamesTheFlag) {
  RecordingOptions options;
  for (const double scale : {1e-6, 1.0}) {
    options.metres_per_unit = scale;
    EXPECT_THAT(expect_error(Error::Kind::usage, options).message,
                AllOf(HasSubstr("median depth"), HasSubstr("outside 0.2 to 10 m"), HasSubstr("--depth-scale")));
  }
  set_camera_info(camera_info_text(16, 12, "500.0", "depth_scale: 0.1"));
  EXPECT_THAT(expect_error(Error::Kind::failed).message,
              AllOf(HasSubstr("median depth"), HasSubstr("camera_info.yaml"), HasSubstr("--depth-scale")));
}

TEST_F(RecordingOptionsTest, AScaleThatCannotBeIsNamed) {
  RecordingOptions options;
  for (const double scale : {0.0, -0.001, std::nan("")}) {
    options.metres_per_unit = scale;
    EXPECT_THAT(expect_error(Error::Kind::usage, options).message,
                AllOf(HasSubstr("--depth-scale "), HasSubstr("above 0")));
  }
  set_camera_info(camera_info_text(16, 12, "500.0", "depth_scale: -0.001"));
  EXPECT_THAT(expect_error(Error::Kind::failed).message,
              AllOf(HasSubstr("camera_info.yaml: depth_scale: got -0.001"), HasSubstr("--depth-scale")));
}

TEST_F(RecordingOptionsTest, AScaleFlagThatContradictsTheFileWinsAndSaysSo) {
  RecordingOptions options;
  options.metres_per_unit = 0.002;
  auto opened = open_recording(folder.path(), options);
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().metres_per_unit, 0.002);
  EXPECT_THAT(opened->notes,
              ElementsAre(HasSubstr("camera_info.yaml: says depth_scale 0.001; --depth-scale 0.002 is used")));
  DepthFrame frame;
  ASSERT_EQ(opened->source->next(frame, {}), FrameOutcome::ok);
  EXPECT_EQ(frame.metres_per_unit, 0.002);
}

TEST_F(RecordingOptionsTest, AFrameRangeIsHalfOpenAndKeepsTheIndices) {
  RecordingOptions options;
  options.frames = {1, 3};
  auto opened = open_recording(folder.path(), options);
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->info().frame_count, 2);
  const auto seen = play(*opened->source);
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[0].frame.index, 1);
  EXPECT_EQ(seen[1].frame.index, 2);
  options.frames = {3, 100};
  opened = open_recording(folder.path(), options);
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(play(*opened->source).size(), 2u);
}

TEST_F(RecordingOptionsTest, ARangeWithoutFramesIsRefused) {
  RecordingOptions options;
  for (const FrameRange range : {FrameRange{5, {}}, FrameRange{2, 2}, FrameRange{3, 1}, FrameRange{-1, 2}}) {
    options.frames = range;
    EXPECT_THAT(expect_error(Error::Kind::usage, options).message,
                AllOf(HasSubstr("--frames " + std::to_string(range.begin) + ":"), HasSubstr("frames 0 to 4")));
  }
}

TEST_F(RecordingOptionsTest, RealtimeWaitsForTheRecordedMomentAndLosesNothing) {
  write_text(folder / "depth.txt",
             "10 depth/000000.png\n100000 depth/000001.png\n20 depth/000002.png\n20 depth/000003.png\n");
  RecordingOptions options;
  options.pace = Pace::realtime;
  auto opened = open_recording(folder.path(), options);
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  DepthFrame frame;
  EXPECT_EQ(opened->source->next(frame, std::chrono::milliseconds(0)), FrameOutcome::ok);
  for (int i = 0; i < 3; ++i) {  // a day ahead: asked again and again, the frame is still to come
    EXPECT_EQ(opened->source->next(frame, std::chrono::milliseconds(1)), FrameOutcome::timeout);
  }
  options.frames = {2, {}};  // equal stamps are due at once, and a stamp that went back is not waited for
  opened = open_recording(folder.path(), options);
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_EQ(opened->source->next(frame, std::chrono::milliseconds(0)), FrameOutcome::corrupt);
  EXPECT_EQ(opened->source->next(frame, std::chrono::milliseconds(0)), FrameOutcome::ok);
  EXPECT_EQ(frame.index, 3);
  EXPECT_EQ(opened->source->next(frame, std::chrono::milliseconds(0)), FrameOutcome::end_of_stream);
  EXPECT_EQ(opened->source->next(frame, std::chrono::milliseconds(0)), FrameOutcome::end_of_stream);
}

}  // namespace
}  // namespace tubetrack
