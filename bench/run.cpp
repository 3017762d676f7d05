#include "run.hpp"

#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack::bench {

namespace {

/// Sequences have seeds of their own, so that more single scenes don't change them.
constexpr std::uint64_t kSequenceSeeds = 500000;

/// The frame of one scene that all methods see.
struct Shot {
  RenderedFrame rendered;
  Eigen::Isometry3d camera_from_truth = Eigen::Isometry3d::Identity();
  std::vector<TubeBound> bounds;  ///< by place in the truth
};

Scene scene_at(const SuiteScene& suite, int frame) {
  Scene now = suite.scene;
  if (suite.place) suite.place(frame, now);
  return now;
}

/// The pixels with a return of each true tube, as they would be without noise.
std::vector<std::vector<SurfacePixel>> surface_pixels(const Scene& scene, int frame, const Shot& shot) {
  const ExactImage exact = exact_image(scene, frame);
  const std::vector<Eigen::Vector2f> rays = ray_table(scene.camera);
  std::vector<std::vector<Eigen::Vector3d>> lines;
  for (const TrueTube& tube : shot.rendered.truth.tubes) {
    lines.emplace_back();
    for (const Eigen::Vector3d& point : tube.centerline_m) lines.back().push_back(shot.camera_from_truth * point);
  }
  std::vector<std::vector<SurfacePixel>> pixels(lines.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto tube = static_cast<std::size_t>(exact.object[i]);
    if (exact.object[i] < 0 || tube >= lines.size() || shot.rendered.depth[i] == 0) continue;
    SurfacePixel pixel;
    pixel.point_m = exact.depth_m[i] * rays[i].cast<double>().homogeneous();
    const LineFoot foot = foot_on_line(pixel.point_m, lines[tube]);
    if (foot.beyond_end) continue;  // a cap
    pixel.normal = (pixel.point_m - foot.point_m).normalized();
    pixel.along = foot.along;
    pixel.from_start_m = foot.from_start_m;
    pixels[tube].push_back(pixel);
  }
  return pixels;
}

Shot take_shot(const SuiteScene& suite, int frame, const RunOptions& options, bool with_bounds) {
  Shot shot;
  shot.rendered = render(suite, frame, options.noise);
  shot.camera_from_truth = world_from_camera(suite.scene, frame).inverse();
  if (!with_bounds) return shot;
  const auto pixels = surface_pixels(scene_at(suite, frame), frame, shot);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    shot.bounds.push_back(cramer_rao_bound(pixels[i], options.bound_piece_radii * suite.scene.tubes[i].radius_m,
                                           options.noise.sensor, suite.scene.camera.fx_px));
  }
  return shot;
}

/// A tube's place in the truth is its id − 1.
void add_bounds(const Shot& shot, Figures& figures) {
  if (shot.bounds.empty()) return;
  for (const NodeError& node : figures.calibration.nodes) {
    const auto tube = static_cast<std::size_t>(node.true_id) - 1;
    const LineFoot foot = foot_on_line(shot.camera_from_truth.inverse() * node.true_point_m,
                                       shot.rendered.truth.tubes[tube].centerline_m);
    for (const PieceBound& piece : shot.bounds[tube].pieces) {
      if (foot.from_start_m < piece.from_m || foot.from_start_m >= piece.to_m || !std::isfinite(piece.sigma_m))
        continue;
      figures.sigma_over_bound.push_back(node.sigma_m / piece.sigma_m);
      figures.bound_rms_m.push_back(piece.rms_m);
    }
  }
  for (const TubeError& tube : figures.calibration.tubes) {
    if (tube.true_id == 0 || tube.radius_sigma_m <= 0.0) continue;
    const double bound_m = shot.bounds[static_cast<std::size_t>(tube.true_id) - 1].radius_sigma_m;
    if (!std::isfinite(bound_m)) continue;
    figures.radius_sigma_over_bound.push_back(tube.radius_sigma_m / bound_m);
    figures.radius_bound_m.push_back(bound_m);
  }
}

/// Everything about one frame but its score, which may need the frames before it.
Figures frame_figures(const Shot& shot, const TubeFrame& result, double took_ms) {
  Figures figures;
  figures.frames = 1;
  figures.reported_tubes = static_cast<std::int64_t>(result.tubes.size());
  figures.frame_ms = {took_ms};
  figures.stages = {result.stages};
  add_frame(figures.calibration, shot.rendered.truth, result, shot.camera_from_truth, {});
  add_bounds(shot, figures);
  figures.bends = bend_errors(shot.rendered.truth, result);
  return figures;
}

TubeFrame timed(const Detector& detector, const DepthFrame& frame, double& took_ms) {
  const auto start = std::chrono::steady_clock::now();
  TubeFrame result = detector(frame);
  took_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  result.frame = frame.index;
  return result;
}

TubeScore score_of(const std::vector<TruthFrame>& truth, const std::vector<TubeFrame>& results,
                   std::int64_t first_frame) {
  ScoreRules rules;
  rules.first_frame = first_frame;
  const auto score = score_run(truth, results, rules);
  if (!score) throw std::runtime_error(score.error().message);
  return score->total;
}

void run_single(const SuiteScene& suite, const std::vector<Method>& methods, const RunOptions& options,
                std::vector<RowResult>& out) {
  const Shot shot = take_shot(suite, suite.single_frame, options, true);
  for (std::size_t i = 0; i < methods.size(); ++i) {
    const Detector detector = methods[i].start(suite.scene.camera);
    double took_ms = 0.0;
    const TubeFrame result = timed(detector, depth_frame(shot.rendered), took_ms);
    Figures figures = frame_figures(shot, result, took_ms);
    figures.score = score_of({shot.rendered.truth}, {result}, 0);
    add(out[i].single, figures);
  }
}

void run_sequence(const SuiteScene& suite, const std::vector<Method>& methods, const RunOptions& options,
                  std::vector<RowResult>& out) {
  std::vector<Detector> detectors;
  detectors.reserve(methods.size());
  for (const Method& method : methods)
    detectors.push_back(method.follows ? method.start(suite.scene.camera) : Detector());
  std::vector<TruthFrame> truth;
  std::vector<std::vector<TubeFrame>> results(methods.size());
  const int last = suite.scene.frames - 1;
  for (int frame = 0; frame <= last; ++frame) {
    Shot shot = take_shot(suite, frame, options, frame == last);
    for (std::size_t i = 0; i < methods.size(); ++i) {
      if (!detectors[i]) continue;
      double took_ms = 0.0;
      results[i].push_back(timed(detectors[i], depth_frame(shot.rendered), took_ms));
      const Figures figures = frame_figures(shot, results[i].back(), took_ms);
      add(out[i].sequence, figures);
      if (frame == last) add(out[i].last, figures);
    }
    truth.push_back(std::move(shot.rendered.truth));
  }
  for (std::size_t i = 0; i < methods.size(); ++i) {
    if (!detectors[i]) continue;
    Figures whole, end;
    whole.score = score_of(truth, results[i], 0);
    end.score = score_of(truth, results[i], last);
    add(out[i].sequence, whole);
    add(out[i].last, end);
  }
}

/// Calls `work` for 0 … count − 1 from so many threads; the first exception is thrown on when all have stopped.
void in_parallel(int jobs, std::size_t count, const std::function<void(std::size_t)>& work,
                 const std::function<void()>& after_each) {
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr problem;
  const auto worker = [&] {
    for (std::size_t place = next++; place < count; place = next++) {
      try {
        work(place);
        const std::lock_guard lock(mutex);
        after_each();
      } catch (...) {
        const std::lock_guard lock(mutex);
        problem = problem ? problem : std::current_exception();
        next = count;
      }
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < jobs; ++i) others.emplace_back(worker);
  worker();
  for (std::thread& other : others) other.join();
  if (problem) std::rethrow_exception(problem);
}

}  // namespace

Method tubetrack_method() {
  return {"tubetrack", [](const Intrinsics& camera) -> Detector {
            TrackerConfig config;
            config.noise = DepthNoise{}.sensor;
            auto created = TubeTracker::create(config, camera);
            if (!created) throw std::runtime_error(created.error().message);
            const auto tracker = std::make_shared<TubeTracker>(std::move(*created));
            return [tracker](const DepthFrame& frame) { return tracker->track(frame); };
          }};
}

std::vector<RowResult> run_row(const Row& row, const std::vector<Method>& methods, const RunOptions& options,
                               const std::function<void()>& progress) {
  const int sequences = row.frames > 0 ? options.sequences : 0;
  std::vector<std::vector<RowResult>> by_scene(static_cast<std::size_t>(options.single_scenes + sequences),
                                               std::vector<RowResult>(methods.size()));
  in_parallel(
      options.jobs, by_scene.size(),
      [&](std::size_t place) {
        const bool single = place < static_cast<std::size_t>(options.single_scenes);
        const std::uint64_t seed =
            single ? place : kSequenceSeeds + place - static_cast<std::size_t>(options.single_scenes);
        const SuiteScene scene = make_scene(row, options.first_seed + seed);
        (single ? run_single : run_sequence)(scene, methods, options, by_scene[place]);
      },
      progress);
  std::vector<RowResult> out(methods.size());
  for (const auto& scene : by_scene) {
    for (std::size_t i = 0; i < methods.size(); ++i) {
      add(out[i].single, scene[i].single);
      add(out[i].sequence, scene[i].sequence);
      add(out[i].last, scene[i].last);
    }
  }
  return out;
}

}  // namespace tubetrack::bench
