#include "tubetrack/report/overlay.hpp"

#include <gmock/gmock.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "replay/recording_files.hpp"

namespace tubetrack {
namespace {

constexpr double kDepth_m = 0.8;
constexpr double kDrawnRadius_m = 0.04;

class Overlay : public testing::Test {
 protected:
  /// A horizontal tube through the image centre, over a flat wall.
  Overlay() : pixels_(640 * 480, 1200) {
    intrinsics_ = {640, 480, 570.0, 570.0, 319.5, 239.5, {}};
    frame_.pixels = pixels_.data();
    frame_.width = 640;
    frame_.height = 480;
    frame_.stride_bytes = 640 * 2;
    Tube tube;
    tube.id = 3;
    tube.radius_m = kDrawnRadius_m;
    for (int i = 0; i <= 20; ++i) tube.centerline_m.emplace_back(-0.2 + 0.02 * i, 0.0, kDepth_m);
    tube.node_visible.assign(21, true);
    result_.tubes = {tube};
  }

  cv::Mat written() {
    const auto path = folder_ / "a.png";
    const auto done = write_overlay(path, frame_, intrinsics_, result_);
    EXPECT_TRUE(done) << done.error().message;
    return cv::imread(path.string(), cv::IMREAD_COLOR);
  }

  static bool coloured(const cv::Mat& picture, int u, int v) {
    const auto p = picture.at<cv::Vec3b>(v, u);
    return std::max({p[0], p[1], p[2]}) - std::min({p[0], p[1], p[2]}) > 40;
  }

  test::TemporaryFolder folder_;
  std::vector<std::uint16_t> pixels_;
  Intrinsics intrinsics_;
  DepthFrame frame_;
  TubeFrame result_;
};

TEST_F(Overlay, DrawsCentrelineAndSilhouettesWhereTheyProject) {
  const cv::Mat picture = written();
  ASSERT_EQ(picture.size(), cv::Size(640, 480));
  // The line of sight that grazes a cylinder of radius R at distance d has slope R / √(d² − R²).
  const int half_px = static_cast<int>(
      std::lround(570.0 * kDrawnRadius_m / std::sqrt(kDepth_m * kDepth_m - kDrawnRadius_m * kDrawnRadius_m)));
  EXPECT_TRUE(coloured(picture, 230, 240));
  EXPECT_TRUE(coloured(picture, 230, 240 + half_px) || coloured(picture, 230, 239 + half_px));
  EXPECT_TRUE(coloured(picture, 230, 240 - half_px) || coloured(picture, 230, 239 - half_px));
  EXPECT_FALSE(coloured(picture, 230, 240 + half_px / 2));
  EXPECT_FALSE(coloured(picture, 100, 240));
}

TEST_F(Overlay, HiddenPartsAreDashed) {
  result_.tubes[0].node_visible.assign(21, false);
  const cv::Mat picture = written();
  int on = 0;
  for (int u = 200; u < 300; ++u) on += coloured(picture, u, 240) ? 1 : 0;
  EXPECT_GT(on, 30);
  EXPECT_LT(on, 80);
}

TEST_F(Overlay, WorldTubesAreBroughtIntoTheCamera) {
  frame_.world_from_camera = Eigen::Isometry3d(Eigen::Translation3d(5.0, -3.0, 2.0));
  result_.frame_id = "world";
  for (auto& node : result_.tubes[0].centerline_m) node = *frame_.world_from_camera * node;
  EXPECT_TRUE(coloured(written(), 230, 240));
}

TEST_F(Overlay, TubesBehindOrAroundTheCameraDoNoHarm) {
  Tube& tube = result_.tubes[0];
  tube.centerline_m = {{0, 0, -1}, {0, 0, 0}, {0, 0, 0}, {0, 0, 1e-9}, {1e9, 0, 1}, {0, 0, 1}};
  tube.node_visible.assign(6, true);
  EXPECT_FALSE(written().empty());
  std::fill(pixels_.begin(), pixels_.end(), std::uint16_t{0});
  result_.tubes[0].centerline_m.clear();
  EXPECT_FALSE(written().empty());
}

TEST_F(Overlay, AFolderThatIsMissingIsAnError) {
  const auto done = write_overlay(folder_ / "no/a.png", frame_, intrinsics_, result_);
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error().message, testing::HasSubstr("no/a.png: the overlay cannot be written"));
}

}  // namespace
}  // namespace tubetrack
