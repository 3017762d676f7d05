#include "speed_run.hpp"

#include <fmt/format.h>

#include <cstring>
#include <stdexcept>

#include "figures.hpp"
#include "floor_pass.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack::bench {

namespace {

TubeTracker new_tracker(const TrackerConfig& config, const Intrinsics& camera) {
  auto tracker = TubeTracker::create(config, camera);
  if (!tracker) throw std::logic_error(tracker.error().message);
  return std::move(*tracker);
}

/// A tracker, and what it told of each frame.
struct TrackerRun {
  TubeTracker tracker;
  std::vector<StageTimes> stages = {};
  std::vector<double> wall_ms = {};
  std::vector<double> tubes = {};

  void track(const DepthFrame& frame) {
    const TubeFrame& result = tracker.track(frame);
    stages.push_back(result.stages);
    wall_ms.push_back(result.latency_ms);
    tubes.push_back(static_cast<double>(result.tubes.size()));
  }
};

/// Where plain passes over a frame leave what they make.
struct PlainPasses {
  std::vector<std::uint16_t> copy;
  FloorPass floor;
  Workers one{1};
};

/// The same for all rows: memcpy, the floor pass and, where it is built in, FALS.
std::vector<Contender> yardsticks(PlainPasses& passes, const Intrinsics& camera, const Peers& peers) {
  const auto copy = [&passes](const DepthFrame& frame) {
    std::memcpy(passes.copy.data(), frame.pixels, passes.copy.size() * sizeof(std::uint16_t));
  };
  passes.copy.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  std::vector<Contender> contenders = {
      {"memcpy", copy}, {"floor pass", [&passes](const DepthFrame& f) { floor_pass(f, passes.floor, passes.one); }}};
  for (PeerContender& peer : peers(camera)) {
    if (peer.yardstick) contenders.push_back(std::move(peer.contender));
  }
  return contenders;
}

SpeedRow row_of(const SpeedScene& speed, const std::vector<RenderedFrame>& frames) {
  SpeedRow row;
  row.name = speed.name;
  row.shows = speed.shows;
  row.width = speed.scene.camera.width;
  row.height = speed.scene.camera.height;
  row.true_tubes = static_cast<int>(speed.scene.tubes.size());
  row.tube_pixels = pixels_on_tubes(speed, frames);
  row.changed_cells = cells_that_change(speed, frames);
  return row;
}

/// The others, each with the frames it gets, for the table of peers.
std::vector<PeerContender> rivals(const Intrinsics& camera, const SpeedOptions& options, const Peers& peers) {
  std::vector<PeerContender> chosen;
  for (PeerContender& peer : peers(camera)) {
    if (peer.yardstick) continue;
    if (peer.slow) peer.contender.every = options.slow_every;
    chosen.push_back(std::move(peer));
  }
  return chosen;
}

/// One race on a scene: a row for each configuration, and what the rivals took.
struct RaceResult {
  std::vector<SpeedRow> rows;
  std::vector<PeerTimes> rivals;
};

RaceResult run_race(const SpeedScene& speed, const std::vector<TrackerConfig>& configs,
                    const std::vector<PeerContender>& rivals, const SpeedOptions& options, const Peers& peers) {
  const Intrinsics& camera = speed.scene.camera;
  const std::vector<RenderedFrame> frames = render_all(speed, options.distinct);
  PlainPasses passes;
  std::vector<Contender> contenders = yardsticks(passes, camera, peers);
  const std::size_t first_tracker = contenders.size();
  std::vector<TrackerRun> runs;
  runs.reserve(configs.size());
  for (const TrackerConfig& config : configs) runs.push_back({new_tracker(config, camera)});
  for (TrackerRun& run : runs) contenders.push_back({"tubetrack", [&run](const DepthFrame& f) { run.track(f); }});
  const std::size_t first_rival = contenders.size();
  for (const PeerContender& rival : rivals) contenders.push_back(rival.contender);
  const auto times = race(frames, contenders, options.distinct, options.frames, options.row_seconds);
  RaceResult result;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    SpeedRow row = i == 0 ? row_of(speed, frames) : result.rows.front();
    row.frame_ms = times[first_tracker + i];
    row.stages.assign(runs[i].stages.begin() + options.distinct, runs[i].stages.end());
    row.wall_ms.assign(runs[i].wall_ms.begin() + options.distinct, runs[i].wall_ms.end());
    row.mean_tubes = mean({runs[i].tubes.begin() + options.distinct, runs[i].tubes.end()});
    row.copy_ms = times[0];
    row.floor_ms = times[1];
    if (first_tracker > 2) row.fals_ms = times[2];
    result.rows.push_back(std::move(row));
  }
  for (std::size_t i = 0; i < rivals.size(); ++i) {
    PeerTimes peer{rivals[i].contender.name, rivals[i].does, times[first_rival + i]};
    if (rivals[i].tubes) peer.mean_tubes = mean(*rivals[i].tubes);
    result.rivals.push_back(std::move(peer));
  }
  return result;
}

/// The same scene while the volume in view that the map could hold grows eightfold: twice the depth, the same cells.
std::vector<SpeedRow> run_volumes(const SpeedOptions& options, const Peers& peers) {
  const SpeedScene speed = moving_tube_scene();
  std::vector<TrackerConfig> configs;
  for (const double depth_m : {1.6, 3.2, 6.4}) {
    configs.push_back(speed_config(speed.scene.camera));
    configs.back().depth_max_m = depth_m;
    configs.back().cell_m = 0.003;
  }
  std::vector<SpeedRow> rows = run_race(speed, configs, {}, options, peers).rows;
  rows[0].name = "×1: to 1.6 m";
  rows[1].name = "×8: to 3.2 m";
  rows[2].name = "×64: to 6.4 m";
  return rows;
}

FirstFrames run_first(const SpeedScene& speed, const SpeedOptions& options) {
  const std::vector<RenderedFrame> frames = render_all(speed, options.distinct);
  FirstFrames first{speed.name, static_cast<int>(speed.scene.tubes.size()), 0.0, {}, {}, {}};
  std::vector<double> tubes;
  for (int i = 0; i < options.first_frames; ++i) {
    TubeTracker tracker = new_tracker(speed_config(speed.scene.camera), speed.scene.camera);
    const double start_ms = thread_ms();
    const TubeFrame& result = tracker.track(played_frame(frames, i));
    first.ms.push_back(thread_ms() - start_ms);
    first.wall_ms.push_back(result.latency_ms);
    first.stages.push_back(result.stages);
    tubes.push_back(static_cast<double>(result.tubes.size()));
  }
  first.mean_tubes = mean(tubes);
  return first;
}

}  // namespace

TrackerConfig speed_config(const Intrinsics& camera) {
  TrackerConfig config;
  config.noise = speed_noise(camera).sensor;
  return config;
}

SpeedReport run_speed(const SpeedOptions& options, const Peers& peers,
                      const std::function<void(const std::string&)>& progress) {
  SpeedReport report;
  report.options = options;
  const auto row = [&](const SpeedScene& speed) {
    progress(fmt::format("{}, {} × {}", speed.name, speed.scene.camera.width, speed.scene.camera.height));
    return run_race(speed, {speed_config(speed.scene.camera)}, {}, options, peers).rows.front();
  };
  report.scenes.push_back(row(still_scene()));
  progress("moving tube, with the peers");
  const SpeedScene moving = moving_tube_scene();
  SpeedOptions longer = options;
  longer.row_seconds *= 2.0;
  RaceResult with_rivals =
      run_race(moving, {speed_config(moving.scene.camera)}, rivals(moving.scene.camera, options, peers), longer, peers);
  report.scenes.push_back(std::move(with_rivals.rows.front()));
  report.peers = std::move(with_rivals.rivals);
  for (const SpeedScene& speed : {moving_camera_scene(), three_tubes_scene(), no_tube_scene()}) {
    report.scenes.push_back(row(speed));
  }
  report.sizes = {row(moving_tube_scene(320, 240)), report.scenes[1], row(moving_tube_scene(1280, 720))};
  for (const int tubes : {1, 4, 16}) report.counts.push_back(row(many_tubes_scene(tubes)));
  progress("volume");
  report.volumes = run_volumes(options, peers);
  for (const double share : {0.0, 1.0 / 32, 1.0 / 16, 1.0 / 8, 1.0 / 4, 1.0 / 2}) {
    report.changes.push_back(row(changing_scene(share)));
  }
  for (const SpeedScene& speed : {still_scene(), moving_tube_scene(), moving_camera_scene()}) {
    progress("two threads, " + speed.name);
    report.threads.push_back(run_threads(speed, options));
  }
  for (const SpeedScene& speed :
       {still_scene(), moving_tube_scene(), moving_camera_scene(), three_tubes_scene(), no_tube_scene()}) {
    progress("first frames, " + speed.name);
    report.first.push_back(run_first(speed, options));
  }
  return report;
}

}  // namespace tubetrack::bench
