#include "tubetrack/replay/tube_truth.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <numbers>

#include "replay/recording_files.hpp"
#include "replay/scene_oracle.hpp"
#include "tubetrack/replay/render.hpp"

namespace tubetrack {
namespace {

using ::testing::HasSubstr;

double visible_part(const TrueTube& tube) {
  return static_cast<double>(std::count(tube.visible.begin(), tube.visible.end(), true)) /
         static_cast<double>(tube.visible.size());
}

TEST(TubeTruth, SamplesAreEvery2MillimetresOnTheCenterlineUpToBothCaps) {
  const Scene scene = preset_scene("bent").value();
  const TrueTube tube = render_frame(scene, 0, DepthNoise::none()).truth.tubes.at(0);
  const double length =
      0.17 + 0.10 * 75.0 / 180.0 * std::numbers::pi + 0.10 + 0.09 * 80.0 / 180.0 * std::numbers::pi + 0.18;
  EXPECT_NEAR(tube.length_m, length, 1e-12);
  ASSERT_EQ(tube.centerline_m.size(), static_cast<std::size_t>(std::ceil(length / 0.002)) + 1);
  EXPECT_EQ(tube.centerline_m.front(), scene.tubes[0].start_m);
  for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) {
    EXPECT_LT(test::distance_to_centerline(scene.tubes[0], tube.centerline_m[i]).distance_m, 1e-12);
    if (i + 2 >= tube.centerline_m.size() || i == 0) continue;
    // The chord of 2 mm of arc, bend radius 90 mm or more.
    EXPECT_NEAR((tube.centerline_m[i] - tube.centerline_m[i - 1]).norm(), 0.002, 1e-7);
  }
}

TEST(TubeTruth, ATubeInFullViewIsVisibleWithAndWithoutNoise) {
  const Scene scene = preset_scene("straight").value();
  EXPECT_GE(visible_part(render_frame(scene, 0, DepthNoise::none()).truth.tubes.at(0)), 0.99);
  EXPECT_GE(visible_part(render_frame(scene, 0, {}).truth.tubes.at(0)), 0.98);
}

TEST(TubeTruth, OnlyTheCoveredStretchOfATubeIsInvisible) {
  Scene scene;
  scene.tubes = {{0.02, {-0.2, 0.0, 0.8}, {1, 0, 0}, {0, 1, 0}, {TubePart::straight(0.4)}, {}}};
  scene.solids = {{BoxShape{{0.0, 0.0, 0.4}, {0.05, 0.2, 0.001}, Eigen::Quaterniond::Identity()}, {}}};
  const TrueTube tube = render_frame(scene, 0, DepthNoise::none()).truth.tubes.at(0);
  for (std::size_t i = 2; i + 2 < tube.visible.size(); ++i) {
    // The box's front half hides |x| < 0.05 of the axis's depth; the tube's near side is 20 mm nearer.
    const double x = std::abs(tube.centerline_m[i].x());
    if (x < 0.046 || x > 0.053) {
      EXPECT_EQ(tube.visible[i], x > 0.05) << x;
    }
  }
}

TEST(TubeTruth, TubesOutsideTheViewAndBehindTheWallAreInvisible) {
  Scene scene;
  const auto at = [](double x, double z) {
    return SceneTube{0.02, {x, 0.0, z}, {0, 1, 0}, {1, 0, 0}, {TubePart::straight(0.1)}, {}};
  };
  scene.tubes = {at(0.0, 0.8), at(2.0, 0.8), at(0.0, -0.8), at(0.1, 1.5)};
  scene.solids = {{PlaneShape{{0, 0, 1.2}, {0, 0, -1}}, {}}};
  const TruthFrame truth = render_frame(scene, 0, DepthNoise::none()).truth;
  EXPECT_GE(visible_part(truth.tubes[0]), 0.95);
  for (const std::size_t hidden : {1U, 2U, 3U}) EXPECT_EQ(visible_part(truth.tubes[hidden]), 0.0) << hidden;
}

TEST(TubeTruth, AHandHidesPartOfTheTubeAndLeavesIt) {
  const Scene scene = preset_scene("hand").value();
  EXPECT_GE(visible_part(render_frame(scene, 0, {}).truth.tubes.at(0)), 0.97);
  EXPECT_LE(visible_part(render_frame(scene, 15, {}).truth.tubes.at(0)), 0.85);
}

TEST(TubeTruth, MovingCamerasGiveTruthInTheWorldWhereTubesRest) {
  const Scene scene = preset_scene("moving-camera").value();
  const RenderedFrame first = render_frame(scene, 0, DepthNoise::none());
  const RenderedFrame last = render_frame(scene, 29, DepthNoise::none());
  EXPECT_EQ(first.truth.frame_id, "world");
  EXPECT_EQ(first.truth.tubes[1].centerline_m, last.truth.tubes[1].centerline_m);
  ASSERT_TRUE(first.world_from_camera && last.world_from_camera);
  EXPECT_GT((first.world_from_camera->translation() - last.world_from_camera->translation()).norm(), 0.1);
}

TEST(TubeTruth, AMovingTubeMovesAsItsMotionSays) {
  const Scene scene = preset_scene("moving-tube").value();
  const auto start_at = [&](int frame) {
    return render_frame(scene, frame, DepthNoise::none()).truth.tubes.at(0).centerline_m;
  };
  const auto at_0 = start_at(0);
  const auto at_15 = start_at(15);
  const Motion& motion = scene.tubes[0].motion;
  const Eigen::Vector3d turn = 0.5 * motion.angular_velocity_rad_s;
  const Eigen::AngleAxisd turned(turn.norm(), turn.normalized());
  for (const std::size_t i : {std::size_t{0}, at_0.size() - 1}) {
    const Eigen::Vector3d expected = turned * (at_0[i] - motion.center_m) + motion.center_m + 0.5 * motion.velocity_m_s;
    EXPECT_LT((at_15[i] - expected).norm(), 1e-12);
  }
}

TEST(TubeTruth, LinesReadBackAsWrittenToAMicrometre) {
  const TruthFrame truth = render_frame(preset_scene("crossing").value(), 4, {}).truth;
  const test::TemporaryFolder folder;
  test::write_text(folder / "truth.jsonl", truth_json(truth) + "\n" + truth_json(truth) + "\n");
  const auto read = read_truth(folder / "truth.jsonl");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), 2U);
  const TruthFrame& back = read->at(1);
  EXPECT_EQ(back.frame, 4);
  EXPECT_EQ(back.timestamp_s, truth.timestamp_s);
  EXPECT_EQ(back.frame_id, "camera");
  ASSERT_EQ(back.tubes.size(), truth.tubes.size());
  for (std::size_t t = 0; t < truth.tubes.size(); ++t) {
    EXPECT_EQ(back.tubes[t].id, truth.tubes[t].id);
    EXPECT_EQ(back.tubes[t].radius_m, truth.tubes[t].radius_m);
    EXPECT_EQ(back.tubes[t].length_m, truth.tubes[t].length_m);
    EXPECT_EQ(back.tubes[t].visible, truth.tubes[t].visible);
    ASSERT_EQ(back.tubes[t].centerline_m.size(), truth.tubes[t].centerline_m.size());
    for (std::size_t i = 0; i < truth.tubes[t].centerline_m.size(); ++i) {
      EXPECT_LT((back.tubes[t].centerline_m[i] - truth.tubes[t].centerline_m[i]).cwiseAbs().maxCoeff(), 0.51e-6);
    }
  }
}

TEST(TubeTruth, BadLinesAreNamed) {
  const test::TemporaryFolder folder;
  const auto problem = [&](const std::string& text) {
    test::write_text(folder / "truth.jsonl", text);
    const auto read = read_truth(folder / "truth.jsonl");
    return read ? std::string() : read.error().message;
  };
  const std::string good = R"({"frame": 0, "timestamp_s": 0, "frame_id": "camera", "tubes": []})";
  EXPECT_EQ(problem(good + "\n\n"), "");
  EXPECT_THAT(problem(good + "\n{\"frame\": 1"), HasSubstr("truth.jsonl: line 2: "));
  EXPECT_THAT(problem("{}"), HasSubstr("'frame'"));
  const std::string tube = R"({"id": 1, "radius_m": 0.1, "length_m": 1, "centerline_m": [[0, 0, 1]], "visible": []})";
  EXPECT_THAT(problem(R"({"frame": 0, "timestamp_s": 0, "frame_id": "camera", "tubes": [)" + tube + "]}"),
              HasSubstr("visible: got 0 entries for 1 points"));
  EXPECT_THAT(read_truth(folder / "none.jsonl").error().message, HasSubstr("none.jsonl: cannot be opened"));
}

}  // namespace
}  // namespace tubetrack
