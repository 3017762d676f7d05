#include <stdexcept>

#include "figures.hpp"
#include "floor_pass.hpp"
#include "speed_run.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack::bench {

namespace {

struct ThreadedRun {
  TubeTracker tracker;
  Workers workers;
  FloorPass floor = {};

  ThreadedRun(const SpeedScene& speed, int threads)
      : tracker([&] {
          TrackerConfig config = speed_config(speed.scene.camera);
          config.threads = threads;
          auto made = TubeTracker::create(config, speed.scene.camera);
          if (!made) throw std::logic_error(made.error().message);
          return std::move(*made);
        }()),
        workers(threads) {}
};

}  // namespace

double ThreadsRow::share_of_floor() const {
  return median(frame_ms[0]) / median(frame_ms[1]) / (median(floor_ms[0]) / median(floor_ms[1]));
}

ThreadsRow run_threads(const SpeedScene& speed, const SpeedOptions& options) {
  const std::vector<RenderedFrame> frames = render_all(speed, options.distinct);
  ThreadedRun one(speed, 1), two(speed, 2);
  std::vector<Contender> contenders;
  for (ThreadedRun* run : {&one, &two}) {
    contenders.push_back({"tubetrack", [run](const DepthFrame& f) { run->tracker.track(f); }});
    contenders.push_back({"floor pass", [run](const DepthFrame& f) { floor_pass(f, run->floor, run->workers); }});
  }
  const auto times = race(frames, contenders, options.distinct, options.frames, options.row_seconds, wall_ms);
  return {speed.name, {times[0], times[2]}, {times[1], times[3]}};
}

}  // namespace tubetrack::bench
