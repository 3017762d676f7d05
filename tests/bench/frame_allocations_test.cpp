// How often the tracker asks for memory in a frame, once it has seen some.
#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "allocations.hpp"
#include "figures.hpp"
#include "speed_run.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack::bench {
namespace {

constexpr int kFrames = 30;
constexpr int kWarmUp = 60;  // once forth and back

/// Allocations of each frame after the warm-up, played forth and back twice more.
std::vector<double> allocations_a_frame(const SpeedScene& speed) {
  const std::vector<RenderedFrame> frames = render_all(speed, kFrames);
  TubeTracker tracker = std::move(TubeTracker::create(speed_config(speed.scene.camera), speed.scene.camera).value());
  std::vector<double> counts;
  for (int i = 0; i < 3 * kWarmUp; ++i) {
    const DepthFrame frame = played_frame(frames, i);
    const std::size_t before = allocations_so_far();
    const std::size_t tubes = tracker.track(frame).tubes.size();
    const std::size_t after = allocations_so_far();
    EXPECT_EQ(tubes, speed.scene.tubes.size()) << speed.name << ", frame " << i;
    if (i >= kWarmUp) counts.push_back(static_cast<double>(after - before));
  }
  return counts;
}

double sum(const std::vector<double>& counts) {
  return std::accumulate(counts.begin(), counts.end(), 0.0);
}

// Sanitizers take recycled memory for used after it was freed, so there it is freed (recycled.cpp).
TEST(FrameAllocations, OfAStillSceneAreNone) {
  EXPECT_EQ(sum(allocations_a_frame(still_scene())), 0.0);
}

TEST(FrameAllocations, OfAMovingTubeAreNone) {
  EXPECT_EQ(sum(allocations_a_frame(moving_tube_scene())), 0.0);
}

// What is no tube is looked at again and again, at other sizes: now and then a buffer must be larger than any before.
TEST(FrameAllocations, OfAMovingCameraAreThoseOfABufferThatGrows) {
  const std::vector<double> counts = allocations_a_frame(moving_camera_scene());
  EXPECT_EQ(median(counts), 0.0);
  EXPECT_LE(sum(counts), 3.0);
}

}  // namespace
}  // namespace tubetrack::bench
