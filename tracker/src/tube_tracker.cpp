#include "tubetrack/tracker/tube_tracker.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "stopwatch.hpp"
#include "tubetrack/heightmap/normals.hpp"
#include "tubetrack/tracker/associate.hpp"
#include "tubetrack/tracker/find_tubes.hpp"

namespace tubetrack {

struct TubeTracker::State {
  TrackerConfig config;
  HeightMap map;
  SurfelFinder surfels;
  Identities identities;
  TubeFrame result;
};

namespace {

HeightMapLimits limits_of(const TrackerConfig& config) {
  return {config.depth_min_m, config.depth_max_m,  config.roi_u_px,
          config.roi_v_px,    config.roi_width_px, config.roi_height_px};
}

SurfelOptions surfel_options(const TrackerConfig& config) {
  if (config.radius_m) return {0.9 * *config.radius_m, 1.1 * *config.radius_m};
  return {config.radius_min_m, config.radius_max_m};
}

/// Covariance of a centreline point from that of the control points, and the larger σ across the tube.
void add_uncertainty(const FoundTube& found, double t, Tube& tube) {
  const SplineBasis basis = basis_at(found.model.spline, t);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      const auto row = static_cast<Eigen::Index>(3 * (basis.first + i));
      const auto col = static_cast<Eigen::Index>(3 * (basis.first + j));
      covariance += basis.value[i] * basis.value[j] * found.quality.covariance.block<3, 3>(row, col);
    }
  }
  const Eigen::Vector3d along = derivative_at(found.model.spline, t).normalized();
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = along.unitOrthogonal();
  across.col(1) = along.cross(across.col(0));
  const Eigen::Matrix2d section = across.transpose() * covariance * across;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(section);
  tube.sigma_m.push_back(std::sqrt(std::max(0.0, solver.eigenvalues()[1])));
  tube.node_covariance_m2.push_back(covariance);
}

/// A found tube as a result: nodes about half a radius apart along what is seen.
Tube result_of(const FoundTube& found, const HeightMap& map, const NoiseModel& noise) {
  const double station_m = station_length_m(map, found.model);
  const auto stations = stations_of(map, noise, found.model, found.pixels, station_m);
  Tube tube;
  tube.radius_m = found.model.radius_m;
  tube.radius_sigma_m = found.quality.radius_sigma_m;
  tube.length_m = found.evidence.length_m;
  tube.confidence = std::min(1.0, found.evidence.support);
  const double spacing_m = std::clamp(0.5 * tube.radius_m, 0.002, 0.02);
  const int spans = std::max(2, static_cast<int>(std::ceil(tube.length_m / std::max(spacing_m, station_m))));
  for (int i = 0; i <= spans; ++i) {
    const double t = found.extent.t_begin + (found.extent.t_end - found.extent.t_begin) * i / spans;
    tube.centerline_m.push_back(point_at(found.model.spline, t));
    const auto nearest = std::min_element(stations.begin(), stations.end(), [&](const Station& a, const Station& b) {
      return std::abs(a.t - t) < std::abs(b.t - t);
    });
    tube.node_visible.push_back(nearest != stations.end() && nearest->seen());
    add_uncertainty(found, t, tube);
  }
  return tube;
}

void move_to_world(Tube& tube, const Eigen::Isometry3d& world_from_camera) {
  for (Eigen::Vector3d& point : tube.centerline_m) point = world_from_camera * point;
  for (Eigen::Matrix3d& covariance : tube.node_covariance_m2) {
    covariance = world_from_camera.linear() * covariance * world_from_camera.linear().transpose();
  }
}

}  // namespace

TubeTracker::TubeTracker(std::unique_ptr<State> state) : state_(std::move(state)) {}
TubeTracker::TubeTracker(TubeTracker&&) noexcept = default;
TubeTracker& TubeTracker::operator=(TubeTracker&&) noexcept = default;
TubeTracker::~TubeTracker() = default;

Expected<TubeTracker> TubeTracker::create(const TrackerConfig& config, const Intrinsics& intrinsics) {
  if (auto valid = validate(config); !valid) return tl::make_unexpected(valid.error());
  if (auto valid = validate(intrinsics); !valid) return tl::make_unexpected(valid.error());
  auto state = std::make_unique<State>();
  state->config = config;
  state->map = make_height_map(intrinsics);
  return TubeTracker(std::move(state));
}

const TubeFrame& TubeTracker::track(const DepthFrame& frame) {
  State& s = *state_;
  s.result = {};
  s.result.frame = frame.index;
  s.result.timestamp_s = frame.timestamp_s;
  s.result.frame_id = frame.world_from_camera ? "world" : "camera";
  const Intrinsics& in = s.map.intrinsics;
  if (frame.pose_missing || !frame.pixels || frame.width != in.width || frame.height != in.height) {
    s.result.status = frame.pose_missing ? TrackStatus::no_pose : TrackStatus::corrupt;
    s.result.problem = frame.pose_missing
                           ? "no pose within 20 ms"
                           : fmt::format("image is {}×{}, takes {}×{}", frame.width, frame.height, in.width, in.height);
    return s.result;
  }
  Stopwatch whole;
  Stopwatch stage;
  update(s.map, frame, s.config.noise, limits_of(s.config), !frame.world_from_camera);
  stage.lap(s.result.stages.update_ms);

  const std::span<const Surfel> surfels = s.surfels.find(s.map, s.config.noise, surfel_options(s.config));
  stage.lap(s.result.stages.normals_ms);

  const double cell_m = s.config.cell_m.value_or(matching_cell_m(surfels, in.fx_px));
  AccumulationMap votes(cell_m);  // algorithm 1
  std::vector<VoteRecord> records;
  records.reserve(surfels.size());
  for (const Surfel& surfel : surfels) {
    records.push_back(vote_record(surfel, cell_m));
    votes.add(records.back());
  }
  stage.lap(s.result.stages.accumulate_ms);

  const auto found = find_tubes(votes, surfels, records, s.map, s.config, s.result.stages);  // algorithm 2, section 2.3
  for (const FoundTube& tube : found) s.result.tubes.push_back(result_of(tube, s.map, s.config.noise));
  if (frame.world_from_camera) {
    for (Tube& tube : s.result.tubes) move_to_world(tube, *frame.world_from_camera);
  }
  associate(s.identities, s.result.tubes);
  std::sort(s.result.tubes.begin(), s.result.tubes.end(), [](const Tube& a, const Tube& b) { return a.id < b.id; });
  s.result.status = s.result.tubes.empty() ? TrackStatus::empty : TrackStatus::ok;
  whole.lap(s.result.latency_ms);
  return s.result;
}

}  // namespace tubetrack
