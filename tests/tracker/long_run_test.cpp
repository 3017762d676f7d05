// A tracker that runs for hours. TUBETRACK_LONG_FRAMES says how many frames; scripts/long asks for 100,000.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "tubetrack/replay/render.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr double kGrowth_MB = 400.0;  // what is freed is kept aside for a while
#else
constexpr double kGrowth_MB = 4.0;
#endif

int frames_asked_for() {
  const char* set = std::getenv("TUBETRACK_LONG_FRAMES");
  return set ? std::atoi(set) : 1000;
}

double resident_MB() {
  std::ifstream file("/proc/self/statm");
  double pages = 0.0;
  file >> pages >> pages;
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

/// The preset with a quarter of its pixels, there and back again: what is known to the end must fit what comes.
class Stream {
 public:
  explicit Stream(const char* preset) {
    Scene scene = *load_scene(preset);
    Intrinsics& in = scene.camera;
    in = {in.width / 2, in.height / 2, in.fx_px / 2, in.fy_px / 2, in.cx_px / 2 - 0.25, in.cy_px / 2 - 0.25, {}};
    for (SceneTube& tube : scene.tubes) tube.radius_m = std::max(tube.radius_m, 0.02);  // 14 pixels wide even so
    for (int i = 0; i < kFrames; ++i) frames_.push_back(render_frame(scene, i, {}));
    camera_ = in;
  }
  const Intrinsics& camera() const { return camera_; }
  /// At the turning points a tube's speed is another from one frame to the next: it may be lost for some.
  static bool has_just_turned(int number) { return number % (kFrames - 1) < 5; }
  DepthFrame frame(int number) const {
    const int phase = number % (2 * kFrames - 2);
    DepthFrame frame =
        depth_frame(frames_[static_cast<std::size_t>(phase < kFrames ? phase : 2 * kFrames - 2 - phase)]);
    frame.index = number;
    frame.timestamp_s = number / 30.0;
    return frame;
  }

 private:
  static constexpr int kFrames = 30;
  std::vector<RenderedFrame> frames_;
  Intrinsics camera_;
};

class LongRun : public ::testing::TestWithParam<const char*> {};

TEST_P(LongRun, FindsItsTubeInEveryFrameAndNeedsNoMoreMemoryInTheEnd) {
  const Stream stream(GetParam());
  auto tracker = TubeTracker::create({}, stream.camera());
  ASSERT_TRUE(tracker);
  const int count = frames_asked_for();
  int without = 0;
  std::int64_t last_id = 0;
  std::vector<double> resident;  // after each tenth, in MB
  for (int i = 0; i < count; ++i) {
    const TubeFrame& result = tracker->track(stream.frame(i));
    if (!Stream::has_just_turned(i)) without += result.tubes.empty() ? 1 : 0;
    for (const Tube& tube : result.tubes) last_id = std::max(last_id, tube.id);
    if ((i + 1) % std::max(1, count / 10) == 0) resident.push_back(resident_MB());
  }
  std::printf("%s: %d frames, %d without a tube, highest id %lld; MB after each tenth:", GetParam(), count, without,
              static_cast<long long>(last_id));
  for (const double MB : resident) std::printf(" %.2f", MB);
  std::printf("\n");
  EXPECT_LE(without, count / 1000);
  EXPECT_LE(resident.back(), resident.front() + kGrowth_MB);
}

INSTANTIATE_TEST_SUITE_P(Presets, LongRun, ::testing::Values("moving-tube", "moving-camera"),
                         [](const auto& preset) { return preset.index == 0 ? "MovingTube" : "MovingCamera"; });

}  // namespace
}  // namespace tubetrack
