// How often the tracker asks for memory in a frame, once it has seen some.
#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "allocations.hpp"
#include "speed_run.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack::bench {
namespace {

constexpr int kFrames = 30;
constexpr int kRound = 60;  // forth and back

/// Allocations of each frame after so many rounds, in two more.
std::vector<double> allocations_a_frame(const SpeedScene& speed, int rounds) {
  const std::vector<RenderedFrame> frames = render_all(speed, kFrames);
  TubeTracker tracker = std::move(TubeTracker::create(speed_config(speed.scene.camera), speed.scene.camera).value());
  std::vector<double> counts;
  for (int i = 0; i < (rounds + 2) * kRound; ++i) {
    const DepthFrame frame = played_frame(frames, i);
    const std::size_t before = allocations_so_far();
    const std::size_t tubes = tracker.track(frame).tubes.size();
    const std::size_t after = allocations_so_far();
    EXPECT_EQ(tubes, speed.scene.tubes.size()) << speed.name << ", frame " << i;
    if (i >= rounds * kRound) counts.push_back(static_cast<double>(after - before));
  }
  return counts;
}

double sum(const std::vector<double>& counts) {
  return std::accumulate(counts.begin(), counts.end(), 0.0);
}

// Sanitizers take recycled memory for used after it was freed, so there it is freed (recycled.cpp).
TEST(FrameAllocations, OfAStillSceneAreNone) {
  EXPECT_EQ(sum(allocations_a_frame(still_scene(), 1)), 0.0);
}

TEST(FrameAllocations, OfAMovingTubeAreNone) {
  EXPECT_EQ(sum(allocations_a_frame(moving_tube_scene(), 1)), 0.0);
}

// What is no tube is looked at again and again, at other sizes: it takes longer until no buffer must be larger than any
// before.
TEST(FrameAllocations, OfAMovingCameraAreNone) {
  EXPECT_EQ(sum(allocations_a_frame(moving_camera_scene(), 2)), 0.0);
}

}  // namespace
}  // namespace tubetrack::bench
