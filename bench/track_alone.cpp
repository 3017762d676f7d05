// Tracks frames of the speed benchmark's 640 × 480 scenes, each rendered just before, in a program without any peer,
// and prints how much memory that took at most, in MB (10⁶ bytes). Rendering is in it.
#include <fmt/format.h>
#include <sys/resource.h>

#include <cstdio>
#include <exception>

#include "speed_run.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack::bench {
namespace {

constexpr int kFrames = 30;

void track_all(const SpeedScene& speed) {
  const DepthNoise noise = speed_noise(speed.scene.camera);
  auto tracker = TubeTracker::create(speed_config(speed.scene.camera), speed.scene.camera);
  for (int k = 0; k < kFrames; ++k) {
    const RenderedFrame rendered = render_frame(scene_at(speed, k, kFrames), k, noise);
    tracker.value().track(depth_frame(rendered));
  }
}

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / 1e6;
}

}  // namespace
}  // namespace tubetrack::bench

int main() {
  using namespace tubetrack::bench;
  try {
    for (const SpeedScene& speed : {still_scene(), moving_tube_scene(), moving_camera_scene(), three_tubes_scene(),
                                    no_tube_scene(), many_tubes_scene(16)}) {
      track_all(speed);
    }
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "track_alone: %s\n", problem.what());
    return 1;
  }
  fmt::print("{:.0f}\n", peak_memory_mb());
  return 0;
}
