#include "plane_run.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "interrupts.hpp"
#include "progress.hpp"
#include "scan_outputs.hpp"
#include "scan_result.hpp"
#include "tubetrack/heightmap/plane_map.hpp"
#include "tubetrack/replay/height_map_file.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack {

namespace {

struct FusedFrames {
  PlaneMap map;
  std::int64_t fused = 0, left_out = 0;  ///< frames
  std::int64_t last_index = 0;
  double last_timestamp_s = 0.0;
};

Expected<void> fuse_frame(const DepthFrame& frame, const TrackerConfig& config, double cell_size_m, HeightMap& readings,
                          FusedFrames& fused) {
  const HeightMapLimits limits{config.depth_min_m, config.depth_max_m,  config.roi_u_px,
                               config.roi_v_px,    config.roi_width_px, config.roi_height_px};
  update(readings, frame, config.noise, limits, false);
  readings.at_disparity_levels = lies_at_disparity_levels(frame, config.noise).value_or(readings.at_disparity_levels);
  const Eigen::Isometry3d pose = frame.world_from_camera.value_or(Eigen::Isometry3d::Identity());
  if (fused.fused == 0) {
    const auto plane = largest_plane(readings);
    if (!plane) {
      return tl::make_unexpected(
          Error::failed("--map plane: the first frame shows no plane; give --frames from one that does, or leave --map "
                        "out"));
    }
    fused.map = make_plane_map(*plane, pose, readings, cell_size_m);
  }
  fuse(fused.map, readings, config.noise, pose);
  ++fused.fused;
  fused.last_index = frame.index;
  fused.last_timestamp_s = frame.timestamp_s;
  return {};
}

Expected<FusedFrames> fuse_all(FrameSource& source, const TrackerConfig& config, const PlaneRunOptions& options) {
  const Intrinsics& camera = source.info().intrinsics;
  HeightMap readings = make_height_map(camera);
  readings.at_disparity_levels = true;  // as the noise model says, until a frame tells otherwise
  FusedFrames fused;
  Progress progress(options.quiet, source.info().frame_count);
  DepthFrame frame;
  while (!interrupted()) {
    const FrameOutcome outcome = source.next(frame, std::chrono::seconds(1));
    if (outcome == FrameOutcome::end_of_stream) return fused;
    if (outcome == FrameOutcome::timeout) continue;
    if (outcome == FrameOutcome::device_lost)
      return tl::make_unexpected(Error::failed(fmt::format("{}: {}", source.info().name, source.last_problem())));
    const bool good = outcome == FrameOutcome::ok && !frame.pose_missing && frame.width == camera.width &&
                      frame.height == camera.height;
    if (!good) {
      ++fused.left_out;
      continue;
    }
    if (auto taken = fuse_frame(frame, config, options.cell_size_m, readings, fused); !taken)
      return tl::make_unexpected(taken.error());
    progress.show(fused.fused + fused.left_out, fmt::format("fused {}  left out {}", fused.fused, fused.left_out));
  }
  return fused;
}

}  // namespace

Expected<int> run_plane_map(FrameSource& source, const TrackerConfig& config, const PlaneRunOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  catch_interrupts();
  auto fused = fuse_all(source, config, options);
  if (!fused) return tl::make_unexpected(fused.error());
  if (fused->fused == 0)
    return tl::make_unexpected(Error::failed(fmt::format("{}: not one good frame came", source.info().name)));
  // Ctrl-C ends the fusing: the tubes of what was fused until then are still told.
  const bool ended_early = interrupted();
  const std::string frame_id = source.info().has_poses ? "world" : "camera";
  const HeightMapFile file = height_map_file_of(fused->map, frame_id);
  if (!options.save_heightmap.empty()) {
    if (auto written = write_height_map(file, options.save_heightmap); !written)
      return tl::make_unexpected(written.error());
  }
  const Scan scan = scan_of(file);
  const std::vector<ScanSurfel> surfels = surfels_of(scan);
  ScanTubesConfig tubes;
  tubes.radius_m = config.radius_m;
  tubes.radius_min_m = config.radius_min_m;
  tubes.radius_max_m = config.radius_max_m;
  tubes.min_length_radii = config.min_length_radii;
  auto result = tubes_of_scan(scan, surfels, tubes, options.any_radius);
  if (!result) return tl::make_unexpected(result.error());
  result->frame = fused->last_index;
  result->timestamp_s = fused->last_timestamp_s;
  result->frame_id = frame_id;
  result->latency_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  const std::vector<NominalComparison> compared = compare_with_nominal(options.nominal.tubes, result->tubes);
  const std::string line =
      line_with_findings(*result, options.with_timing, {{}, compared, options.nominal.tolerance_m});
  if (options.out.empty()) {
    fmt::print("{}\n", line);
  } else if (auto written = write_text_file("--out", options.out, line + "\n"); !written) {
    return tl::make_unexpected(written.error());
  }
  if (!options.quiet) {
    print_tubes(result->tubes);
    fmt::print(stderr,
               "{} frames in a map of {} x {} cells of {:.2g} mm ({} bad or without a pose left out); {} tube(s)\n",
               fused->fused, file.width, file.height, 1e3 * file.cell_size_m, fused->left_out, result->tubes.size());
    print_nominal(compared);
  }
  if (ended_early) return 130;
  if (options.strict && fused->left_out > 0) {
    return tl::make_unexpected(Error::failed(
        fmt::format("{}: --strict, and {} frames are bad or without a pose", source.info().name, fused->left_out)));
  }
  if (auto judged = judge_nominal(source.info().name, compared, options.nominal.tolerance_m); !judged)
    return tl::make_unexpected(judged.error());
  return 0;
}

}  // namespace tubetrack
