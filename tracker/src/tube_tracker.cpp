#include "tubetrack/tracker/tube_tracker.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "followed_extent.hpp"
#include "hide.hpp"
#include "stopwatch.hpp"
#include "tube_result.hpp"
#include "tubetrack/heightmap/normals.hpp"
#include "tubetrack/tracker/associate.hpp"
#include "tubetrack/tracker/find_tubes.hpp"
#include "tubetrack/tracker/join.hpp"
#include "tubetrack/tracker/recast.hpp"

namespace tubetrack {

struct TubeTracker::State {
  explicit State(const TrackerConfig& from) : config(from), workers(from.threads) {}

  TrackerConfig config;
  Workers workers;
  HeightMap map;
  bool levels_are_known = false;
  SurfelFinder surfels;
  AccumulationMap votes{0.0};
  CastVotes cast;       // what is in `votes`
  int search_turn = 0;  // which part of the image was looked at last
  RecycledVector<FailedPlace> failed;
  KnownTubes known;
  std::optional<Eigen::Isometry3d> world_from_camera;  // of the last frame
  std::optional<double> timestamp_s;                   // of the last frame
  std::vector<std::uint8_t> explained;                 // a cell each, bits: a known tube is seen there, was before
  TubeFrame result;
};

namespace {

// Seeds that may fail in a frame before the search is left to the next; the first frame may be all there is.
constexpr int kFailuresAtFirst = 60;
constexpr int kFailuresLater = 10;
// Wider ones show their curvature.
constexpr double kWidestStrip_px = 16.0;

HeightMapLimits limits_of(const TrackerConfig& config) {
  return {config.depth_min_m, config.depth_max_m,  config.roi_u_px,
          config.roi_v_px,    config.roi_width_px, config.roi_height_px};
}

SurfelOptions surfel_options(const TrackerConfig& config) {
  SurfelOptions options{config.radius_min_m, config.radius_max_m};
  if (config.radius_m) options = {0.9 * *config.radius_m, 1.1 * *config.radius_m};
  options.narrowest_strip_px = config.min_width_px;
  options.widest_strip_px = kWidestStrip_px;
  return options;
}

/// With a moving camera every cell is new in every frame, and to look for tubes in all of it takes twice as long as all
/// else. So after the first frame that is done in two fifths of the rows at a time, so that what comes into view is
/// looked for within two frames: the upper, the middle, the lower; what one of them cuts lies within another.
void choose_rows(int turn, int height, SurfelOptions& options) {
  const int first_tenth = 3 * (turn % 3);
  options.v_begin = height * first_tenth / 10;
  options.v_end = height * (first_tenth + 4) / 10;
}

constexpr std::uint8_t kSeenNow = 1;
constexpr std::uint8_t kSeenBefore = 2;

/// Is what changed looked at in turns? While the camera stands still, and tubes are known of which none is missed: then
/// it is mostly theirs.
bool in_turns(const DepthFrame& frame, const KnownTubes& known) {
  return !frame.world_from_camera && !known.tubes.empty() &&
         std::ranges::all_of(known.tubes, [](const FollowedTube& tube) { return tube.state == TubeState::tracked; });
}

/// Marks the cells in which a tube is seen.
void explain(const HeightMap& map, const FollowedTube& tube, std::vector<std::uint8_t>& explained) {
  if (tube.state != TubeState::tracked) return;
  const PredictedPixels& pixels = tube.pixels;
  const double near_m = 0.5 * tube.model.radius_m;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::uint32_t cell = pixels.cell[i];
    const float off = std::abs(map.depth_m[cell] - pixels.depth_m[i]);
    const bool in_extent = (pixels.t[i] >= tube.extent.t_begin) & (pixels.t[i] <= tube.extent.t_end);
    if (in_extent & (off < near_m + 4.0F * pixels.sigma_m[i])) explained[cell] |= kSeenNow;
  }
}

/// Where one fits, the other does not count: of two tubes in one place the one known longer stays.
void drop_doubles(KnownTubes& known) {
  auto& tubes = known.tubes;
  for (std::size_t i = 0; i < tubes.size(); ++i) {
    for (std::size_t j = tubes.size(); j-- > i + 1;) {
      if (tubes[i].state != TubeState::tracked || tubes[j].state != TubeState::tracked) continue;
      if (!same_tube(tubes[j].model, tubes[j].extent, tubes[i].model, tubes[i].extent)) continue;
      tubes.erase(tubes.begin() + static_cast<std::ptrdiff_t>(j));
    }
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
  auto state = std::make_unique<State>(config);
  state->map = make_height_map(intrinsics);
  state->map.at_disparity_levels = true;  // as the noise model says, until a frame tells otherwise
  state->surfels.make_room(state->map, state->workers);
  state->explained.resize(state->map.rays.size());
  state->cast.now.reserve(state->map.rays.size());
  state->cast.before.reserve(state->map.rays.size());
  return TubeTracker(std::move(state));
}

bool TubeTracker::begin(const DepthFrame& frame) {
  State& s = *state_;
  s.result.status = TrackStatus::ok;
  s.result.problem.clear();
  s.result.latency_ms = 0.0;
  s.result.stages = {};
  s.result.frame = frame.index;
  s.result.timestamp_s = frame.timestamp_s;
  s.result.frame_id = frame.world_from_camera ? "world" : "camera";
  const Intrinsics& in = s.map.intrinsics;
  if (frame.pose_missing) {
    s.result.status = TrackStatus::no_pose;
    s.result.problem = "no pose within 20 ms";
    return false;
  }
  if (!frame.pixels || frame.width != in.width || frame.height != in.height) {
    s.result.status = TrackStatus::corrupt;
    s.result.problem = fmt::format("image is {}×{}, takes {}×{}", frame.width, frame.height, in.width, in.height);
    return false;
  }
  return true;
}

/// How readings are written is the sensor's and the recording's: once a frame has told, a few are asked again.
void TubeTracker::ask_for_levels(const DepthFrame& frame) {
  constexpr std::uint32_t kEvery = 8;
  State& s = *state_;
  if (s.levels_are_known && s.map.frame % kEvery != 0) return;
  const std::optional<bool> told = lies_at_disparity_levels(frame, s.config.noise);
  if (!told) return;
  s.map.at_disparity_levels = *told;
  s.levels_are_known = true;
}

void TubeTracker::follow_known(const DepthFrame& frame) {
  State& s = *state_;
  // A gap in time says nothing of how far a tube may have gone on at its last speed.
  const double elapsed_s = std::clamp(frame.timestamp_s - s.timestamp_s.value_or(frame.timestamp_s), 0.0, 0.2);
  s.timestamp_s = frame.timestamp_s;
  if (frame.world_from_camera && s.world_from_camera) {
    const Eigen::Isometry3d new_from_old = frame.world_from_camera->inverse() * *s.world_from_camera;
    for (FollowedTube& tube : s.known.tubes) transform(tube, new_from_old);
    for (FailedPlace& place : s.failed) place.position_m = new_from_old * place.position_m;
  }
  s.world_from_camera = frame.world_from_camera;
  HiddenCells hidden;
  for (FollowedTube& tube : s.known.tubes) {
    const SeenTube mine = seen(tube);
    hide_others(s.known.tubes, &tube, &mine, s.map, hidden);
    // Behind a hand its shadow and what it hides look alike, and the tube would come apart.
    const bool open = std::ranges::none_of(tube.stations, tubetrack::hidden);
    if (open) hide_beside_gaps(mine, s.map, hidden);
    follow_tube(tube, s.map, s.config, frame.timestamp_s, elapsed_s);
    show_again(s.map, hidden);
  }
  drop_doubles(s.known);
  join_known(s.known, s.map, s.config, frame.timestamp_s);
  confirm_or_forget(s.known, s.map, s.config);
  forget_old(s.known, frame.timestamp_s);
  // In turns surfels may be of the frame before, in which a tube was where it was then.
  const int kept = in_turns(frame, s.known) ? kSeenBefore : 0;
  for (std::uint8_t& cell : s.explained) cell = static_cast<std::uint8_t>(cell << 1 & kept);
  for (const FollowedTube& tube : s.known.tubes) explain(s.map, tube, s.explained);
}

void TubeTracker::report_known() {
  State& s = *state_;
  std::size_t count = 0;
  for (const FollowedTube& tube : s.known.tubes) {
    if (!tube.confirmed) continue;
    if (count == s.result.tubes.size()) s.result.tubes.emplace_back();
    Tube& result = s.result.tubes[count++];
    set_result(tube, s.map, result);
    Stopwatch parts;
    add_parts(result);  // section 3
    parts.lap(s.result.stages.segment_ms);
    add_unseen_motion(result, tube, s.result.timestamp_s);
    if (!s.config.radius_m) add_common_error(result, s.config.noise.radius_relative);
    if (s.world_from_camera) move_to_world(result, *s.world_from_camera);
  }
  s.result.tubes.resize(count);
  std::sort(s.result.tubes.begin(), s.result.tubes.end(), [](const Tube& a, const Tube& b) { return a.id < b.id; });
  s.result.status = s.result.tubes.empty() ? TrackStatus::empty : TrackStatus::ok;
}

const TubeFrame& TubeTracker::track(const DepthFrame& frame) {
  State& s = *state_;
  if (!begin(frame)) {
    s.result.tubes.clear();
    return s.result;
  }
  StageTimes& stages = s.result.stages;
  Deadline deadline(s.config.deadline_ms);
  Stopwatch whole;
  Stopwatch stage;
  update(s.map, frame, s.config.noise, limits_of(s.config), !frame.world_from_camera, s.workers);
  ask_for_levels(frame);
  stage.lap(stages.update_ms);

  follow_known(frame);  // section 2.3, from where the last frame left each tube
  stage.lap(stages.fit_ms);

  SurfelOptions options = surfel_options(s.config);
  const int max_failures = s.known.first_frame ? kFailuresAtFirst : kFailuresLater;
  if (frame.world_from_camera && !s.known.first_frame) choose_rows(s.search_turn++, frame.height, options);
  options.in_turns = in_turns(frame, s.known);
  const std::span<const Surfel> surfels = s.surfels.find(s.map, s.config.noise, options, s.explained, s.workers);
  stage.lap(stages.normals_ms);

  const double cell_m = s.config.cell_m.value_or(matching_cell_m(surfels, s.map.intrinsics.fx_px));
  if (s.votes.cell_m() != cell_m) {
    s.votes.restart(cell_m);
    s.cast.now.clear();
  }
  recast(s.votes, s.cast, surfels);  // algorithm 1
  stage.lap(stages.accumulate_ms);

  auto found = find_tubes(s.votes, surfels, s.cast.now, s.known.tubes, s.map, s.config, max_failures, deadline,
                          s.failed, stages);  // algorithm 2, section 2.3
  stage = {};
  take_in(s.known, std::move(found), s.map, s.config, frame.timestamp_s);
  stage.lap(stages.fit_ms);
  report_known();
  if (deadline.missed()) {
    s.result.status = TrackStatus::deadline;
    s.result.problem =
        fmt::format("{:g} ms were over before all places were looked at", s.config.deadline_ms.value_or(0.0));
  }
  whole.lap(s.result.latency_ms);
  return s.result;
}

}  // namespace tubetrack
