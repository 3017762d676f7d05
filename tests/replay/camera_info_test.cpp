#include "tubetrack/replay/camera_info.hpp"

#include <gmock/gmock.h>

#include "recording_files.hpp"

namespace tubetrack {
namespace {

using test::camera_info_text;
using test::TemporaryFolder;
using test::write_text;
using ::testing::HasSubstr;

Expected<CameraInfo> parse(const std::string& text) {
  const TemporaryFolder folder;
  write_text(folder / "camera_info.yaml", text);
  return read_camera_info(folder / "camera_info.yaml");
}

std::string problem(const std::string& text) {
  const auto info = parse(text);
  if (info) return "";
  EXPECT_EQ(info.error().kind, Error::Kind::failed);
  EXPECT_EQ(info.error().message.find('\n'), std::string::npos);
  return info.error().message;
}

TEST(CameraInfo, WhatIsWrittenIsReadBackToTheLastBit) {
  Intrinsics in;
  in.width = 641;
  in.height = 479;
  in.fx_px = 570.342205;
  in.fy_px = 1.0 / 3.0;
  in.cx_px = 319.49999999999994;
  in.cy_px = 1e-17;
  in.distortion = {0.1, -0.2, 1e-5, 0.3, 1.0 / 7.0, 0.0, 0.0, 0.0};
  for (const double k6 : {0.0, -0.017}) {  // five coefficients, then eight
    in.distortion[7] = k6;
    const auto info = parse(camera_info_yaml(in, 1.0 / 5000.0));
    ASSERT_TRUE(info.has_value()) << info.error().message;
    EXPECT_EQ(info->intrinsics.width, in.width);
    EXPECT_EQ(info->intrinsics.height, in.height);
    EXPECT_EQ(info->intrinsics.fx_px, in.fx_px);
    EXPECT_EQ(info->intrinsics.fy_px, in.fy_px);
    EXPECT_EQ(info->intrinsics.cx_px, in.cx_px);
    EXPECT_EQ(info->intrinsics.cy_px, in.cy_px);
    EXPECT_EQ(info->intrinsics.distortion, in.distortion);
    EXPECT_EQ(info->metres_per_unit, 1.0 / 5000.0);
  }
}

TEST(CameraInfo, ScaleAndDistortionMayBeLeftOut) {
  const auto info = parse(camera_info_text(16, 12, "500.0", ""));
  ASSERT_TRUE(info.has_value()) << info.error().message;
  EXPECT_FALSE(info->metres_per_unit.has_value());
  EXPECT_FALSE(info->intrinsics.has_distortion());
}

TEST(CameraInfo, AMissingOrWrongFieldIsNamed) {
  EXPECT_THAT(problem("image_width: 16\n"), HasSubstr("camera_info.yaml: image_height is missing"));
  EXPECT_THAT(problem("image_width: 16\nimage_height: 12\n"), HasSubstr("camera_matrix.data is missing"));
  EXPECT_THAT(problem("image_width: 16\nimage_height: 12\ncamera_matrix: 5\n"),
              HasSubstr("camera_matrix.data is missing"));
  EXPECT_THAT(problem("image_width: wide\nimage_height: 12\n"), HasSubstr("image_width: got \"wide\", takes pixels"));
  EXPECT_THAT(problem("image_width: 16\nimage_height: 12\ncamera_matrix: {data: [1, 2]}\n"),
              HasSubstr("camera_matrix.data: got 2 numbers, takes 9"));
  EXPECT_THAT(problem("image_width: 16\nimage_height: 12\ncamera_matrix: {data: [5, 1, 2, 0, 5, 2, 0, 0, 1]}\n"),
              HasSubstr("camera_matrix.data: got [5"));
  EXPECT_THAT(problem(camera_info_text(16, 12, "broad")),
              HasSubstr("camera_matrix.data[0]: got \"broad\", takes a number"));
  EXPECT_THAT(problem(camera_info_text(16, 12) + "distortion_model: equidistant\n"),
              HasSubstr("distortion_model: got \"equidistant\", takes plumb_bob"));
  EXPECT_THAT(problem(camera_info_text(16, 12, "500", "depth_scale: mm")), HasSubstr("depth_scale: got \"mm\""));
  EXPECT_THAT(problem("image_width: [\n"), HasSubstr("no YAML"));
  EXPECT_THAT(problem(""), HasSubstr("takes a ROS camera_info"));
}

}  // namespace
}  // namespace tubetrack
