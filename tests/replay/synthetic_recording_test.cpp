#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "replay/recording_files.hpp"
#include "tubetrack/replay/recording.hpp"
#include "tubetrack/replay/render.hpp"

namespace tubetrack {
namespace {

TEST(SyntheticRecording, EveryPresetReadsBackPixelForPixelWithItsTruth) {
  for (const std::string_view name : preset_names()) {
    SCOPED_TRACE(name);
    Scene scene = preset_scene(name).value();
    scene.frames = name == "moving-camera" ? 3 : 1;
    const test::TemporaryFolder folder;
    ASSERT_TRUE(write_synthetic_recording(scene, {}, folder / "r"));
    auto opened = open_recording(folder / "r", {});
    ASSERT_TRUE(opened) << opened.error().message;
    EXPECT_THAT(opened->notes, testing::IsEmpty()) << "nothing has to be assumed";
    EXPECT_EQ(opened->source->info().metres_per_unit, 0.001);
    EXPECT_EQ(opened->source->info().has_poses, name == "moving-camera");
    const auto truth = read_truth(folder / "r/truth.jsonl");
    ASSERT_TRUE(truth) << truth.error().message;
    ASSERT_EQ(truth->size(), static_cast<std::size_t>(scene.frames));
    for (int frame = 0; frame < scene.frames; ++frame) {
      const RenderedFrame rendered = render_frame(scene, frame, {});
      DepthFrame read;
      ASSERT_EQ(opened->source->next(read, std::chrono::milliseconds(1000)), FrameOutcome::ok);
      EXPECT_NEAR(read.timestamp_s, rendered.timestamp_s, 1e-9);
      std::size_t returns = 0;
      for (int v = 0; v < read.height; ++v) {
        ASSERT_TRUE(std::equal(read.row(v), read.row(v) + read.width, rendered.depth.begin() + v * read.width));
        returns += static_cast<std::size_t>(
            std::count_if(read.row(v), read.row(v) + read.width, [](std::uint16_t d) { return d != 0; }));
      }
      EXPECT_GT(returns, 640U * 480U * 9U / 10U);
      ASSERT_EQ(read.world_from_camera.has_value(), rendered.world_from_camera.has_value());
      if (read.world_from_camera) {
        EXPECT_TRUE(read.world_from_camera->isApprox(*rendered.world_from_camera, 1e-9));
      }
      EXPECT_EQ(truth->at(static_cast<std::size_t>(frame)).tubes.size(), scene.tubes.size());
    }
    DepthFrame none;
    EXPECT_EQ(opened->source->next(none, std::chrono::milliseconds(1000)), FrameOutcome::end_of_stream);
  }
}

TEST(SyntheticRecording, SameSceneSameFiles) {
  Scene scene = preset_scene("bent").value();
  scene.frames = 2;
  const test::TemporaryFolder folder;
  ASSERT_TRUE(write_synthetic_recording(scene, {}, folder / "a"));
  ASSERT_TRUE(write_synthetic_recording(scene, {}, folder / "b"));
  const auto bytes = [](const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  for (const char* name : {"depth.txt", "camera_info.yaml", "truth.jsonl", "depth/000000.png", "depth/000001.png"}) {
    EXPECT_FALSE(bytes(folder / "a" / name).empty()) << name;
    EXPECT_EQ(bytes(folder / "a" / name), bytes(folder / "b" / name)) << name;
  }
}

TEST(SyntheticRecording, RefusesAFolderThatHoldsSomethingElseAndAnInvalidScene) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "thesis.txt", "all my work");
  Scene scene = preset_scene("straight").value();
  scene.frames = 1;
  EXPECT_EQ(write_synthetic_recording(scene, {}, folder.path()).error().kind, Error::Kind::usage);
  scene.frames = 0;
  EXPECT_THAT(write_synthetic_recording(scene, {}, folder / "r").error().message, testing::HasSubstr("frames: got 0"));
  EXPECT_FALSE(std::filesystem::exists(folder / "r"));
}

}  // namespace
}  // namespace tubetrack
