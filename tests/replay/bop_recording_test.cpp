#include <gmock/gmock.h>

#include "recording_files.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kCamera = R"("cam_K": [500.0, 0.0, 7.5, 0.0, 501.0, 5.5, 0.0, 0.0, 1.0], "depth_scale": 0.1)";

/// depth_scale 0.1 mm a unit: the plane of write_depth lies at 0.9 m.
void write_scene(const std::filesystem::path& folder, const std::string& json) {
  for (const char* name : {"000002.png", "000010.png"}) write_depth(folder / "depth" / name, 16, 12, 0, 9000);
  write_text(folder / "scene_camera.json", json);
}

std::string entry(const std::string& id, const std::string& rest = "") {
  return "\"" + id + "\": {" + kCamera + rest + "}";
}

TEST(BopRecording, ReadsCameraScaleAndImagesInNumberOrder) {
  const TemporaryFolder folder;
  write_scene(folder.path(), "{" + entry("10") + "," + entry("2") + "}");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_THAT(opened->notes, ElementsAre(HasSubstr("30 frames a second assumed")));
  const StreamInfo& info = opened->source->info();
  EXPECT_EQ(info.intrinsics.width, 16);
  EXPECT_EQ(info.intrinsics.height, 12);
  EXPECT_EQ(info.intrinsics.fx_px, 500.0);
  EXPECT_EQ(info.intrinsics.fy_px, 501.0);
  EXPECT_EQ(info.intrinsics.cx_px, 7.5);
  EXPECT_EQ(info.intrinsics.cy_px, 5.5);
  EXPECT_DOUBLE_EQ(info.metres_per_unit, 0.0001);
  EXPECT_FALSE(info.has_poses);
  const auto seen = play(*opened->source);
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[1].outcome, FrameOutcome::ok) << seen[1].problem;
  EXPECT_DOUBLE_EQ(seen[1].frame.timestamp_s, 1.0 / 30.0);
}

TEST(BopRecording, WorldToCameraInMillimetresBecomesWorldFromCamera) {
  const TemporaryFolder folder;
  // The camera at (1, 2, 3) m, turned so that its x axis is the world's y: R = rows of the camera's axes in the world.
  write_scene(folder.path(),
              "{" + entry("2", R"(, "cam_R_w2c": [0, 1, 0, -1, 0, 0, 0, 0, 1], "cam_t_w2c": [-2000, 1000, -3000])") +
                  "," + entry("10") + "}");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  EXPECT_TRUE(opened->source->info().has_poses);
  const auto seen = play(*opened->source);
  ASSERT_EQ(seen.size(), 2u);
  const Eigen::Isometry3d pose = pose_or_nan(seen[0].frame.world_from_camera);
  EXPECT_LT((pose.translation() - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  EXPECT_LT((pose.linear() * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_FALSE(seen[0].frame.pose_missing);
  EXPECT_TRUE(seen[1].frame.pose_missing);
}

TEST(BopRecording, AMissingImageIsACorruptFrame) {
  const TemporaryFolder folder;
  write_scene(folder.path(), "{" + entry("2") + "," + entry("3") + "," + entry("10") + "}");
  auto opened = open_recording(folder.path(), {});
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  const auto seen = play(*opened->source);
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_EQ(seen[1].outcome, FrameOutcome::corrupt);
  EXPECT_THAT(seen[1].problem, HasSubstr("000003.png: cannot be opened"));
}

TEST(BopRecording, WhatIsWrongInTheJsonIsNamed) {
  const TemporaryFolder folder;
  const auto message = [&](const std::string& json) {
    write_scene(folder.path(), json);
    const Error error = error_of(folder.path());
    EXPECT_EQ(error.kind, Error::Kind::failed);
    return error.message;
  };
  EXPECT_THAT(message("{"), HasSubstr("scene_camera.json: no JSON"));
  EXPECT_THAT(message("{}"), HasSubstr("scene_camera.json: takes an object with one entry an image"));
  EXPECT_THAT(message(R"({"two": {}})"), HasSubstr("got key \"two\", takes image numbers"));
  EXPECT_THAT(message(R"({"2": {"depth_scale": 1.0}})"), HasSubstr("image 2: cam_K: got nothing, takes 9 numbers"));
  EXPECT_THAT(message(R"({"2": {"cam_K": [1, 2]}})"), HasSubstr("image 2: cam_K: got [1,2], takes 9 numbers"));
  EXPECT_THAT(message("{" + entry("2", R"(, "cam_R_w2c": [1,0,0,0,1,0,0,0,1])") + "}"),
              HasSubstr("image 2: cam_t_w2c: got nothing, takes 3 numbers"));
  EXPECT_THAT(message("{" + entry("2", R"(, "cam_R_w2c": [2,0,0,0,1,0,0,0,1], "cam_t_w2c": [0,0,0])") + "}"),
              HasSubstr("cam_R_w2c: got determinant 2, takes a rotation matrix"));
  EXPECT_THAT(message(R"({"2": {"cam_K": [0, 0, 7.5, 0, 501, 5.5, 0, 0, 1], "depth_scale": 0.1}})"),
              AllOf(HasSubstr("scene_camera.json: fx: got 0"), HasSubstr("--intrinsics")));
  EXPECT_THAT(
      message("{" + entry("2") + R"(, "10": {"cam_K": [600, 0, 7.5, 0, 501, 5.5, 0, 0, 1], "depth_scale": 0.1}})"),
      HasSubstr("image 10: cam_K: got fx,fy,cx,cy 600,501,7.5,5.5 after 500,501,7.5,5.5"));
}

}  // namespace
}  // namespace tubetrack
