// What the tracker says does not depend on how many threads share its work, nor on the vectors they work with.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cstdlib>
#include <filesystem>

#include "tubetrack/replay/recording.hpp"
#include "tubetrack/replay/render.hpp"
#include "tubetrack/report/result_json.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack {
namespace {

constexpr int kFrames = 6;

struct Frames {
  Intrinsics camera;
  std::vector<RenderedFrame> rendered;  ///< what the next are views of
  std::vector<DepthFrame> frames;
};

/// A preset with a quarter of its pixels.
Frames frames_of(const char* preset) {
  Scene scene = *load_scene(preset);
  Intrinsics& in = scene.camera;
  in = {in.width / 2, in.height / 2, in.fx_px / 2, in.fy_px / 2, in.cx_px / 2 - 0.25, in.cy_px / 2 - 0.25, {}};
  for (SceneTube& tube : scene.tubes) tube.radius_m = std::max(tube.radius_m, 0.02);
  Frames frames{in, {}, {}};
  for (int i = 0; i < kFrames; ++i) frames.rendered.push_back(render_frame(scene, i, {}));
  for (const RenderedFrame& frame : frames.rendered) frames.frames.push_back(depth_frame(frame));
  return frames;
}

/// The result lines of all frames, and how many tubes are in them.
struct Said {
  std::string lines;
  std::size_t tubes = 0;
};

Said track(const Frames& frames, int threads) {
  TrackerConfig config;
  config.threads = threads;
  TubeTracker tracker = std::move(TubeTracker::create(config, frames.camera).value());
  Said said;
  for (const DepthFrame& frame : frames.frames) {
    const TubeFrame& result = tracker.track(frame);
    said.lines += result_line(result, false) + "\n";
    said.tubes += result.tubes.size();
  }
  return said;
}

class SameBytes : public ::testing::TestWithParam<const char*> {};

TEST_P(SameBytes, WithAnyNumberOfThreads) {
  const Frames frames = frames_of(GetParam());
  const Said one = track(frames, 1);
  EXPECT_GE(one.tubes, std::size_t{kFrames} / 2);
  for (const int threads : {2, 4}) EXPECT_EQ(track(frames, threads).lines, one.lines) << threads;
}

TEST_P(SameBytes, WithEveryVectorLength) {
  const Frames frames = frames_of(GetParam());
  const Said best = track(frames, 1);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    EXPECT_EQ(track(frames, 1).lines, best.lines) << hwy::TargetName(target);
  }
  hwy::SetSupportedTargetsForTest(0);
}

INSTANTIATE_TEST_SUITE_P(Scenes, SameBytes, ::testing::Values("moving-tube", "moving-camera"),
                         [](const auto& scene) { return std::string(scene.param).substr(7); });

TEST(SameBytesOfARecording, WithAnyNumberOfThreads) {
  const char* set = std::getenv("TUBETRACK_TEST_DATA");
  const std::filesystem::path folder =
      (set ? std::filesystem::path(set) : std::filesystem::path(TUBETRACK_SOURCE_DIR) / "../shared/data") /
      "glue-f200-seq50";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  std::string one;
  for (const int threads : {1, 2, 4}) {
    auto recording = open_recording(folder, {});
    ASSERT_TRUE(recording) << recording.error().message;
    TrackerConfig config;
    config.threads = threads;
    TubeTracker tracker = std::move(TubeTracker::create(config, recording->source->info().intrinsics).value());
    std::string lines;
    DepthFrame frame;
    for (int i = 0; i < 2 * kFrames; ++i) {
      ASSERT_EQ(recording->source->next(frame, std::chrono::seconds(1)), FrameOutcome::ok);
      lines += result_line(tracker.track(frame), false) + "\n";
    }
    if (threads == 1) one = lines;
    EXPECT_EQ(lines, one) << threads;
  }
}

}  // namespace
}  // namespace tubetrack
