#include <gmock/gmock.h>

#include "recording_files.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// Recordings made by others, with their own sensors. Skipped, saying so, where they are not there.
class RealRecordings : public ::testing::Test {
 protected:
  void SetUp() override {
    if (real_data().empty()) GTEST_SKIP() << "no real recordings: set TUBETRACK_TEST_DATA to their folder";
  }

  static RecordingOptions options(std::array<double, 4> intrinsics_px) {
    RecordingOptions result;
    result.intrinsics_px = intrinsics_px;
    result.metres_per_unit = 0.001;
    return result;
  }

  static void expect_all_ok(const std::filesystem::path& path, const RecordingOptions& options, std::size_t count) {
    auto opened = open_recording(path, options);
    ASSERT_TRUE(opened.has_value()) << opened.error().message;
    const auto seen = play(*opened->source);
    ASSERT_EQ(seen.size(), count);
    for (const SeenFrame& one : seen) {
      ASSERT_EQ(one.outcome, FrameOutcome::ok) << one.problem;
      EXPECT_EQ(one.frame.width, 640);
      EXPECT_EQ(one.frame.height, 480);
      EXPECT_FALSE(one.frame.pose_missing);
    }
  }
};

TEST_F(RealRecordings, XtionFramesAreABareFolderInNaturalOrder) {
  const auto path = real_data() / "osd-xtion/depth";
  expect_all_ok(path, options({525, 525, 319.5, 239.5}), 17);
  // learn0, learn3, learn6, learn20 …: the fourth is learn20 also when it is opened on its own.
  auto all = open_recording(path, options({525, 525, 319.5, 239.5}));
  auto one = open_recording(path / "learn20.png", options({525, 525, 319.5, 239.5}));
  ASSERT_TRUE(all.has_value() && one.has_value());
  const DepthFrame fourth = play(*all->source)[3].frame;
  const DepthFrame learn20 = play(*one->source)[0].frame;
  for (int v = 0; v < 480; ++v) ASSERT_TRUE(std::equal(fourth.row(v), fourth.row(v) + 640, learn20.row(v)));
}

TEST_F(RealRecordings, XtionMillimetresAreNotTakenForTumsScale) {
  RecordingOptions without = options({525, 525, 319.5, 239.5});
  without.metres_per_unit.reset();
  const Error error = error_of(real_data() / "osd-xtion/depth", without);
  EXPECT_EQ(error.kind, Error::Kind::usage);
  EXPECT_THAT(error.message, AllOf(HasSubstr("median depth 0.1"), HasSubstr("--depth-scale 0.001")));
}

TEST_F(RealRecordings, AColourOrLabelFolderIsRefused) {
  EXPECT_THAT(error_of(real_data() / "osd-xtion/label", options({525, 525, 319.5, 239.5})).message,
              HasSubstr("learn0.png: 8-bit with 1 channel(s)"));
  EXPECT_THAT(error_of(real_data() / "kinect-oni/derived/color_05.png", options({525, 525, 319.5, 239.5})).message,
              HasSubstr("color_05.png: 8-bit with 3 channel(s)"));
}

TEST_F(RealRecordings, CansAndMugsAreABareFolder) {
  expect_all_ok(real_data() / "cans-mugs-d415/depth", options({616.3653, 616.2029, 310.2588, 236.5998}), 10);
}

TEST_F(RealRecordings, KinectTiffsAreABareFolder) {
  expect_all_ok(real_data() / "kinect-tiff", options({525, 525, 320, 240}), 3);
}

TEST_F(RealRecordings, GlueHasFiftyFramesWithPosesAndNeedsNoFlags) {
  const auto path = real_data() / "glue-f200-seq50";
  expect_all_ok(path, {}, 50);
  auto opened = open_recording(path, {});
  ASSERT_TRUE(opened.has_value());
  EXPECT_TRUE(opened->notes.empty());
  EXPECT_TRUE(opened->source->info().has_poses);
  EXPECT_EQ(opened->source->info().frame_count, 50);
  EXPECT_EQ(opened->source->info().intrinsics.fx_px, 615.195);
  const auto seen = play(*opened->source);
  EXPECT_EQ(seen[0].frame.timestamp_s, 0.5);
  EXPECT_TRUE(pose_or_nan(seen[0].frame.world_from_camera).isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_TRUE(pose_or_nan(seen[2].frame.world_from_camera)
                  .translation()
                  .isApprox(Eigen::Vector3d(0.008883, 0.001744, 0.028511)));
  for (const SeenFrame& one : seen) EXPECT_TRUE(one.frame.world_from_camera.has_value());
}

}  // namespace
}  // namespace tubetrack
