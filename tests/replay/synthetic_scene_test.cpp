#include "tubetrack/replay/synthetic_scene.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <numbers>
#include <sstream>

#include "replay/recording_files.hpp"
#include "tubetrack/replay/render.hpp"

namespace tubetrack {
namespace {

using ::testing::HasSubstr;

std::string error_of_scene(const std::string& json) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "scene.json", json);
  const auto scene = read_scene_file(folder / "scene.json");
  if (scene) return "";
  EXPECT_EQ(scene.error().kind, Error::Kind::usage);
  EXPECT_THAT(scene.error().message, HasSubstr("scene.json: "));
  EXPECT_THAT(scene.error().message, testing::Not(HasSubstr("\n")));
  return scene.error().message;
}

std::string with_tube(const std::string& tube) {
  return "{\"tubes\": [" + tube + "]}";
}

TEST(SceneFile, ErrorsNameTheField) {
  const std::string straight = R"("start_m": [0, 0, 1], "direction": [1, 0, 0], "parts": [{"type": "straight", )";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "parse error"},
      {"[]", "takes one JSON object"},
      {R"({"tube": []})", "tube: unknown key, takes camera, frames"},
      {R"({})", "solids: is empty"},
      {R"({"frames": 0, "solids": [{"type": "sphere", "center_m": [0,0,1], "radius_m": 0.1}]})", "frames: got 0"},
      {R"({"frames": 2.5})", "frames: got 2.5, takes a whole number"},
      {R"({"frames": 1e12})", "frames: got 1000000000000.0, takes a whole number"},
      {R"({"seed": -1})", "seed: got -1, takes a whole number"},
      {R"({"frames_per_second": "30"})", "frames_per_second: got \"30\", takes a number"},
      {R"({"camera": {"fx": 570}})", "camera.fx: unknown key, takes width"},
      {R"({"camera": {"fx_px": -1}})", "camera.fx: got -1"},
      {R"({"camera": {"distortion": [1,2,3,4,5,6,7,8,9]}})", "camera.distortion: got 9 numbers"},
      {R"({"tubes": {}})", "tubes: got {}, takes a list"},
      {R"({"tubes": [3]})", "tubes[0]: got 3, takes an object"},
      {with_tube(R"({"radius_m": 0.02})"), "tubes[0].start_m: is missing"},
      {with_tube(R"({"radius_m": -0.02, )" + straight + R"("length_m": 1}]})"), "tubes[0].radius_m: got -0.02, takes"},
      {with_tube(R"({"radius_m": 0.02, )" + straight + R"("length_m": 0}]})"), "tubes[0].parts[0].length_m: got 0"},
      {with_tube(R"({"radius_m": 0.02, "radius_profile": [], )" + straight + R"("length_m": 1}]})"),
       "tubes[0].radius_m: is given beside radius_profile"},
      {with_tube(R"({"radius_profile": [{"at_m": 0.1, "radius_m": 0.02}, {"at_m": 0.1, "radius_m": 0.01}], )" +
                 straight + R"("length_m": 1}]})"),
       "tubes[0].radius_profile[1].at_m: got 0.1, takes more than the key before"},
      {with_tube(R"({"radius_m": 0.02, )" + straight + R"("length": 1}]})"), "tubes[0].parts[0].length: unknown key"},
      {with_tube(R"({"radius_m": 0.02, )" + straight + R"("length_m": 1, "angle_rad": 1}]})"),
       "tubes[0].parts[0].angle_rad: unknown key, takes type, length_m"},
      {with_tube(R"({"radius_m": 0.02, )" + straight + R"("length_m": 1}], "bend_direction": [2, 0, 0]})"),
       "tubes[0].bend_direction: is parallel"},
      {with_tube(R"({"radius_m": 0.02, "start_m": [0,0], "direction": [1,0,0], "parts": []})"),
       "tubes[0].start_m: got [0,0], takes a list of 3 numbers"},
      {with_tube(R"({"radius_m": 0.02, "start_m": [0,0,1], "direction": [0,0,0], "parts": []})"),
       "tubes[0].direction: got [0, 0, 0]"},
      {with_tube(R"({"radius_m": 0.02, "start_m": [0,0,1], "direction": [1,0,0], "parts": []})"),
       "tubes[0].parts: is empty"},
      {with_tube(R"({"radius_m": 0.02, "start_m": [0,0,1], "direction": [1,0,0],
                     "parts": [{"type": "arc", "bend_radius_m": 0.1, "angle_rad": 1}]})"),
       "tubes[0].bend_direction: is missing"},
      {with_tube(R"({"radius_m": 0.02, "start_m": [0,0,1], "direction": [1,0,0], "bend_direction": [0,1,0],
                     "parts": [{"type": "arc", "bend_radius_m": 0.02, "angle_rad": 1}]})"),
       "tubes[0].parts[0].bend_radius_m: got 0.02, takes more than the tube's radius_m"},
      {with_tube(R"({"radius_m": 0.02, "start_m": [0,0,1], "direction": [1,0,0], "bend_direction": [0,1,0],
                     "parts": [{"type": "arc", "bend_radius_m": 0.1, "angle_rad": 7}]})"),
       "tubes[0].parts[0].angle_rad: got 7"},
      {with_tube(R"({"radius_m": 0.02, )" + straight + R"("length_m": 1}], "motion": {"speed": 1}})"),
       "tubes[0].motion.speed: unknown key"},
      {R"({"solids": [{"type": "cube"}]})", "solids[0].type: got \"cube\", takes plane, box"},
      {R"({"solids": [{"type": "sphere", "center_m": [0,0,1], "radius_m": 0.1, "size_m": [1,1,1]}]})",
       "solids[0].size_m: unknown key"},
      {R"({"solids": [{"type": "box", "center_m": [0,0,1], "size_m": [1,0,1]}]})", "solids[0].size_m[1]: got 0"},
      {R"({"solids": [{"type": "capsule", "from_m": [0,0,1], "to_m": [0,0,1], "radius_m": 0.1}]})",
       "solids[0].to_m: is the same point"},
      {R"({"solids": [{"type": "sphere", "center_m": [0,0,1], "radius_m": 0.1}],
           "camera_path": [{"time_s": 0, "position_m": [0,0,0], "look_at_m": [0,0,1]},
                           {"time_s": 0, "position_m": [0,0,0], "look_at_m": [0,0,1]}]})",
       "camera_path[1].time_s: got 0, takes a time after the key before"},
      {R"({"solids": [{"type": "sphere", "center_m": [0,0,1], "radius_m": 0.1}],
           "camera_path": [{"time_s": 0, "position_m": [0,0,0], "look_at_m": [0,1,0]}]})",
       "camera_path[0].look_at_m: lies on position_m or straight above"},
  };
  for (const auto& [json, expected] : cases) EXPECT_THAT(error_of_scene(json), HasSubstr(expected)) << json;
}

TEST(SceneFile, TheExampleOfTheDocumentationIsReadAsWritten) {
  std::ifstream file(TUBETRACK_SOURCE_DIR "/docs/scene.md");
  std::stringstream text;
  text << file.rdbuf();
  const std::string page = text.str();
  const std::size_t begin = page.find("```json\n") + 8;
  const std::string example = page.substr(begin, page.find("```", begin) - begin);
  EXPECT_EQ(error_of_scene(example), "");
  const test::TemporaryFolder folder;
  test::write_text(folder / "example.json", example);
  const Scene scene = load_scene((folder / "example.json").string()).value();
  EXPECT_EQ(scene.name, "example");
  ASSERT_EQ(scene.tubes.size(), 1U);
  EXPECT_EQ(scene.tubes[0].parts.size(), 3U);
  EXPECT_EQ(scene.solids.size(), 6U);
  EXPECT_EQ(scene.camera_path.size(), 2U);
  for (const std::string_view name : preset_names()) {
    EXPECT_THAT(page, HasSubstr("`" + std::string(name) + "`")) << "docs/scene.md lists every preset";
  }
}

TEST(SceneFile, AMissingFileAndAnUnknownPresetSayWhatIsTaken) {
  EXPECT_THAT(load_scene("nowhere/scene.json").error().message, HasSubstr("nowhere/scene.json: cannot be read"));
  EXPECT_THAT(load_scene("stright").error().message,
              HasSubstr("got 'stright', takes a .json file or one of straight,"));
}

TEST(Presets, PassTheirOwnValidation) {
  for (const std::string_view name : preset_names()) {
    const auto valid = validate(preset_scene(name).value());
    EXPECT_TRUE(valid) << name << ": " << (valid ? "" : valid.error().message);
  }
}

TEST(Presets, TubesStayWellInsideTheViewInEveryFrame) {
  for (const std::string_view name : preset_names()) {
    const Scene scene = preset_scene(name).value();
    for (const int frame : {0, 10, 20, scene.frames - 1}) {
      const Eigen::Isometry3d camera_from_world = world_from_camera(scene, frame).inverse();
      for (const TrueTube& tube : render_frame(scene, frame, DepthNoise::none()).truth.tubes) {
        for (const Eigen::Vector3d& point : tube.centerline_m) {
          const Eigen::Vector2d pixel = project(scene.camera, camera_from_world * point);
          ASSERT_TRUE(pixel.x() > 25 && pixel.x() < 615 && pixel.y() > 25 && pixel.y() < 455)
              << name << " frame " << frame << " tube " << tube.id << " at " << pixel.transpose();
        }
      }
      if (name != "moving-tube" && name != "moving-camera") break;
    }
  }
}

TEST(Presets, TubesThatLieTogetherTouchAndDoNotCut) {
  const Scene scene = preset_scene("pile").value();
  const TruthFrame truth = render_frame(scene, 0, DepthNoise::none()).truth;
  const auto gap = [&](std::size_t a, std::size_t b) {
    double least = 1.0;
    for (const Eigen::Vector3d& p : truth.tubes[a].centerline_m) {
      for (const Eigen::Vector3d& q : truth.tubes[b].centerline_m) least = std::min(least, (p - q).norm());
    }
    return least - truth.tubes[a].radius_m - truth.tubes[b].radius_m;
  };
  for (const auto& [a, b] : {std::pair{0, 1}, {0, 2}, {1, 2}, {3, 5}, {4, 5}}) {
    // Crossing lines sampled every 2 mm are nearest at samples up to 1 mm from their feet: 0.05 mm too far.
    EXPECT_GT(gap(static_cast<std::size_t>(a), static_cast<std::size_t>(b)), -1e-6) << a << ", " << b;
    EXPECT_LT(gap(static_cast<std::size_t>(a), static_cast<std::size_t>(b)), 0.00006) << a << ", " << b;
  }
}

TEST(CameraPath, PassesThroughItsKeysSmoothly) {
  const Scene scene = preset_scene("moving-camera").value();
  for (const CameraKey& key : scene.camera_path) {
    const int frame = static_cast<int>(std::lround(key.time_s * scene.frames_per_second));
    const Eigen::Isometry3d pose = world_from_camera(scene, frame);
    EXPECT_LT((pose.translation() - key.position_m).norm(), 1e-9);
    const Eigen::Vector3d looked_at = pose.inverse() * key.look_at_m;
    EXPECT_LT(looked_at.head<2>().norm(), 1e-9);
    EXPECT_GT(looked_at.z(), 0.0);
  }
  for (int frame = 1; frame < 28; ++frame) {
    const Eigen::Vector3d before = world_from_camera(scene, frame - 1).translation();
    const Eigen::Vector3d here = world_from_camera(scene, frame).translation();
    const Eigen::Vector3d after = world_from_camera(scene, frame + 1).translation();
    EXPECT_LT((after - 2.0 * here + before).norm(), 0.004) << frame;
  }
}

}  // namespace
}  // namespace tubetrack
