#include "tubetrack/tracker/follow.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "followed_extent.hpp"
#include "frame_fit.hpp"
#include "motion.hpp"
#include "pool.hpp"

namespace tubetrack {

namespace {

constexpr double kRestChi2 = 30.0;      // 6 degrees of freedom: once in 25,000 frames by chance
constexpr int kFramesToComeToRest = 6;  // long enough for 1 mm/s to show
// Radii: so little a placing may still move for the fit to take it along.
constexpr double kSettled = 0.05;
// Radii: at rest the last pixels are taken again while the model is so near to theirs, far below the noise of a
// reading.
constexpr double kUnmoved = 0.002;
// Radii: a frame that leaves a tube's place across its axis this unsure, as the last strip of one that leaves the view,
// does not show it.
constexpr double kVague = 0.05;

/// The motion from where a model is to where the frame sees it; empty where it sees too little to tell.
std::optional<MotionEstimate> motion_seen(const FollowedTube& tube, const TubeModel& model, const FrameView& view) {
  if (view.all.used < 20) return std::nullopt;
  MotionEstimate motion = estimate_motion(model, view.all.matrix, view.all.right, tube.radius_information);
  const Eigen::Vector3d axis = derivative_at(model.spline, 0.5 * (tube.extent.t_begin + tube.extent.t_end));
  if (sigma_across_m(motion, axis.normalized()) > kVague * model.radius_m) return std::nullopt;
  return motion;
}

/// Are the tube's pixels, along what is in sight, nearly those of a model?
bool has_pixels_of(const FollowedTube& tube, const TubeModel& model) {
  const TubeModel& of = tube.predicted;
  const bool same_spans =
      of.spline.control_m.size() == model.spline.control_m.size() && of.spline.first_span == model.spline.first_span;
  const bool one_radius = of.profile.offset_m.empty() && model.profile.offset_m.empty();
  return same_spans && one_radius && moved_m(of, model, tube.extent) <= kUnmoved * model.radius_m;
}

/// Do the readings fit a place worse than another one? Both in sum, where one that is not near counts as if it were
/// four σ off, and on average, as the pixels of two places differ a little in number. A hand that comes in front of a
/// tube at rest pulls at it, but leaves what is still seen of it where it was.
bool fits_worse(const ObservedEquations& near, double other_chi2, int other_used) {
  return near.chi2 - 16.0 * near.used > other_chi2 - 16.0 * other_used &&
         near.chi2 * other_used > other_chi2 * near.used;
}

/// Corrects the velocity by how far from where it was expected a tube was seen.
void learn_velocity(FollowedTube& tube, const Twist& off, double elapsed_s) {
  constexpr double kGain = 0.6;
  if (elapsed_s <= 0.0) return;
  tube.velocity.shift_m_s += kGain * off.shift_m / elapsed_s;
  tube.velocity.turn_rad_s += kGain * off.turn_rad / elapsed_s;
}

/// Goes over from rest to motion and back. `model` starts where the tube is expected and ends where the frame sees it,
/// or so near that one step of the fit goes there, with its pixels predicted and what the frame says of it in `view`.
bool judge_motion(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel& model,
                  double elapsed_s, FrameView& view) {
  if (!tube.at_rest || !has_pixels_of(tube, model)) predict(tube, map, config, model);
  view = view_of(tube, map, config, model, kFitGate, 0.5);
  const auto first = motion_seen(tube, model, view);
  if (!first) return false;
  if (tube.at_rest && motion_chi2(model, *first, tube.pooled.matrix) < kRestChi2) return true;
  TubeModel moved = model;
  move(moved, first->twist);
  if (!tube.at_rest && moved_m(model, moved, tube.extent) <= kSettled * model.radius_m) {
    learn_velocity(tube, first->twist, elapsed_s);
    return true;
  }
  const double chi2_before = view.near.chi2;
  const int used_before = view.near.used;
  model = moved;
  predict(tube, map, config, model);
  view = view_of(tube, map, config, model, kFitGate, 0.25);
  if (tube.at_rest && fits_worse(view.near, chi2_before, used_before)) {
    model = tube.model;
    predict(tube, map, config, model);
    view = view_of(tube, map, config, model, kFitGate, kFitGate);
    return true;
  }
  if (tube.at_rest) {
    tube.at_rest = false;
    tube.frames_pooled = 0;
    tube.anchor = tube.model;
  }
  const auto second = motion_seen(tube, model, view);
  if (!second) return false;
  learn_velocity(tube, {first->twist.shift_m + second->twist.shift_m, first->twist.turn_rad + second->twist.turn_rad},
                 elapsed_s);
  move(moved, second->twist);
  if (moved_m(model, moved, tube.extent) <= kSettled * model.radius_m) return true;
  model = std::move(moved);
  predict(tube, map, config, model);
  view = view_of(tube, map, config, model, kFitGate, kFitGate);
  return true;
}

/// Moving: every few frames, asks whether the tube is still where it was a few frames ago.
void judge_rest(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  if (++tube.frames_pooled < kFramesToComeToRest) return;
  tube.frames_pooled = 0;
  auto pixels = std::exchange(tube.pixels, {});
  auto predicted = std::exchange(tube.predicted, {});
  predict(tube, map, config, tube.anchor);
  const auto back = motion_seen(tube, tube.anchor, view_of(tube, map, config, tube.anchor, kFitGate, 0.5));
  tube.pixels = std::move(pixels);
  tube.predicted = std::move(predicted);
  if (back && motion_chi2(tube.anchor, *back, tube.quality.observed.matrix) < kRestChi2) {
    start_pool(tube);
    add_to_pool(tube);
    return;
  }
  tube.anchor = tube.model;
}

/// The tube as it is before a frame, but for what that replaces or leaves alone in any case, which is large.
FollowedTube set_aside(FollowedTube& tube) {
  auto pixels = std::move(tube.pixels);
  auto stations = std::move(tube.stations);
  auto pooled = std::move(tube.pooled);
  auto quality = std::exchange(tube.quality, {});
  tube.quality.radius_sigma_m = quality.radius_sigma_m;
  FollowedTube before = tube;
  before.quality = std::move(quality);
  tube.pixels = std::move(pixels);
  tube.stations = std::move(stations);
  tube.pooled = std::move(pooled);
  return before;
}

/// Not seen where it is expected: it stays as it was before this frame, but there.
void keep_expected(FollowedTube& tube, FollowedTube before, TubeModel expected) {
  before.model = std::move(expected);
  before.state = tube.state;
  before.pixels = std::move(tube.pixels);
  before.predicted = std::move(tube.predicted);
  before.stations = std::move(tube.stations);
  before.pooled = std::move(tube.pooled);
  tube = std::move(before);
}

}  // namespace

void follow_tube(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, double timestamp_s,
                 double elapsed_s) {
  fit_spline_to_extent(tube);
  if (tube.at_rest) creep_on(tube, elapsed_s);
  TubeModel expected = tube.model;
  if (!tube.at_rest) move(expected, during(tube.velocity, elapsed_s));
  FollowedTube before = set_aside(tube);
  TubeModel model = expected;
  FrameView view;
  bool fitted = judge_motion(tube, map, config, model, elapsed_s, view);
  if (fitted) {
    fitted = fit_once(tube, config, model, std::move(view), tube.at_rest ? tube.pooled : radius_only(tube),
                      tube.at_rest ? &tube.profile_pool : nullptr, true);
    if (fitted) take_model(tube, std::move(model), config);
    if (fitted && is_stale(tube, tube.model)) predict(tube, map, config, tube.model);
  }
  if (!fitted) {
    tube.model = expected;
    predict(tube, map, config, expected);
  }
  look(tube, map);
  if (!fitted && tube.state == TubeState::tracked) tube.state = TubeState::lost;
  if (tube.state != TubeState::tracked) {
    keep_expected(tube, std::move(before), std::move(expected));
    return;
  }
  tube.last_seen_s = timestamp_s;
  ++tube.frames_followed;
  if (tube.at_rest) {
    add_to_pool(tube);
    judge_creep(tube);
  } else {
    judge_rest(tube, map, config);
  }
  add_to_profile_pool(tube);
}

}  // namespace tubetrack
