#include "tubetrack/tracker/follow.hpp"

#include <algorithm>
#include <cmath>

#include "drift.hpp"
#include "motion.hpp"

namespace tubetrack {

namespace {

constexpr double kRestChi2 = 30.0;      // 6 degrees of freedom: once in 25,000 frames by chance
constexpr int kMaxPooledFrames = 60;    // what is older fades
constexpr int kFramesToComeToRest = 6;  // long enough for 1 mm/s to show
constexpr double kEndTrim = 0.6;        // spans

FitOptions fit_options(const TrackerConfig& config, const FollowedTube& tube, const Information* prior) {
  FitOptions options;
  options.radius_m = config.radius_m ? config.radius_m : tube.held_radius_m;
  options.radius_min_m = 0.5 * config.radius_min_m;
  options.radius_max_m = 1.5 * config.radius_max_m;
  options.prior = prior;
  return options;
}

Information no_information(const TubeModel& model) {
  const auto size = static_cast<Eigen::Index>(3 * model.spline.control_m.size() + 1);
  return {Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
}

Information radius_only(const FollowedTube& tube) {
  Information information = no_information(tube.model);
  const Eigen::Index last = information.vector.size() - 1;
  information.matrix(last, last) = tube.radius_information;
  information.vector[last] = tube.radius_information * tube.model.radius_m;
  return information;
}

/// Observations of the stretch that is known, short of its ends: what lies there may be the end's own face, or what it
/// touches. A short piece gives up a tenth at either end.
std::vector<Observation> observe(const HeightMap& map, const TrackerConfig& config, const FollowedTube& tube,
                                 const std::vector<PredictedPixel>& pixels, double gate_m) {
  auto observations = select_observations(map, config.noise, pixels, gate_m, 4.0);
  const double trim = std::min(kEndTrim, 0.1 * (tube.extent.t_end - tube.extent.t_begin));
  std::erase_if(observations, [&](const Observation& observation) {
    return observation.t < tube.extent.t_begin + trim || observation.t > tube.extent.t_end - trim;
  });
  return observations;
}

double inverse(double value) {
  return value > 0.0 ? 1.0 / value : 0.0;
}

void start_pool(FollowedTube& tube) {
  tube.at_rest = true;
  tube.velocity = {};
  tube.frames_pooled = 0;
  tube.pooled_age_s = 0.0;
  tube.pooled = radius_only(tube);
  start_drift(tube.drift, tube.model);
}

void add_to_pool(FollowedTube& tube) {
  const double doubt = std::max(1.0, tube.quality.chi2_per_observation);
  if (++tube.frames_pooled > kMaxPooledFrames) {
    constexpr double kFactor = 1.0 - 1.0 / kMaxPooledFrames;
    tube.pooled.matrix *= kFactor;
    tube.pooled.vector *= kFactor;
    fade(tube.drift, kFactor);
  }
  const Information observed{tube.quality.observed.matrix / doubt, tube.quality.observed.vector / doubt};
  tube.pooled.matrix += observed.matrix;
  tube.pooled.vector += observed.vector;
  tube.pooled_age_s *= 1.0 - 1.0 / std::min(tube.frames_pooled, kMaxPooledFrames);
  add_frame(tube.drift, observed);
}

/// What was pooled, as if everything in it lay elsewhere.
void carry_pool(FollowedTube& tube, const Twist& by) {
  Eigen::Matrix<double, 7, 1> change;
  change << by.shift_m, by.turn_rad, 0.0;
  tube.pooled.vector += tube.pooled.matrix * (by_motion(tube.model) * change);
}

/// At rest, before a frame: what is known of the tube goes on as it creeps.
void creep_on(FollowedTube& tube, double elapsed_s) {
  const Twist by = Twist{tube.velocity.shift_m_s, tube.velocity.turn_rad_s} * elapsed_s;
  carry_pool(tube, by);
  move(tube.model, by);
  move(tube.drift.anchor, by);
  age(tube.drift, elapsed_s);
  tube.pooled_age_s += elapsed_s;
}

/// At rest, after a frame: how fast the tube creeps, seen over all frames pooled. A creeping tube is where the pool's
/// mean frame saw it, and as much farther as it crept since; not knowing that to the end makes the place less sure.
void judge_creep(FollowedTube& tube) {
  const Twist velocity{tube.velocity.shift_m_s, tube.velocity.turn_rad_s};
  const VelocityChange found = judge_velocity(tube.drift, velocity);
  recarry(tube.drift, found.change_per_s);
  tube.velocity.shift_m_s += found.change_per_s.shift_m;
  tube.velocity.turn_rad_s += found.change_per_s.turn_rad;
  const Twist by = found.change_per_s * tube.pooled_age_s;
  carry_pool(tube, by);
  move(tube.model, by);
  const Eigen::MatrixXd jacobian = by_motion(tube.model).leftCols<6>();
  tube.quality.covariance += jacobian * found.added_covariance * jacobian.transpose();
}

/// The motion from where a model is to where the observations are; `enough` false: too few to tell.
struct Placed {
  MotionEstimate estimate;
  bool enough = false;
};
Placed place(const HeightMap& map, const TrackerConfig& config, const FollowedTube& tube, const TubeModel& model,
             double gate_radii) {
  const auto pixels = predict_pixels(map, config.noise, model);
  const auto observations = observe(map, config, tube, pixels, gate_radii * model.radius_m);
  const NormalEquations eq = normal_equations(model, observations, fit_options(config, tube, nullptr));
  if (eq.used < 20) return {};
  return {estimate_motion(model, eq.observed, eq.observed_right, tube.radius_information), true};
}

/// Goes over from rest to motion and back. `model` starts where the tube is expected and ends where the frame sees it.
bool judge_motion(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel& model,
                  double elapsed_s) {
  const Placed first = place(map, config, tube, model, 0.5);
  if (!first.enough) return false;
  if (tube.at_rest) {
    if (motion_chi2(model, first.estimate, tube.pooled.matrix) < kRestChi2) return true;
    tube.at_rest = false;
    tube.frames_pooled = 0;
    tube.anchor = tube.model;
  }
  move(model, first.estimate.twist);
  const Placed second = place(map, config, tube, model, 0.25);
  if (!second.enough) return false;
  move(model, second.estimate.twist);
  const Twist change{first.estimate.twist.shift_m + second.estimate.twist.shift_m,
                     first.estimate.twist.turn_rad + second.estimate.twist.turn_rad};
  if (elapsed_s > 0.0) {
    tube.velocity.shift_m_s += 0.6 * change.shift_m / elapsed_s;
    tube.velocity.turn_rad_s += 0.6 * change.turn_rad / elapsed_s;
  }
  return true;
}

/// Moving: every few frames, asks whether the tube is still where it was a few frames ago.
void judge_rest(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  if (++tube.frames_pooled < kFramesToComeToRest) return;
  tube.frames_pooled = 0;
  const bool same_shape = tube.anchor.spline.control_m.size() == tube.model.spline.control_m.size();
  if (same_shape) {
    const Placed back = place(map, config, tube, tube.anchor, 0.5);
    if (back.enough && motion_chi2(tube.anchor, back.estimate, tube.quality.observed.matrix) < kRestChi2) {
      start_pool(tube);
      add_to_pool(tube);
      return;
    }
  }
  tube.anchor = tube.model;
}

bool fit_to_frame(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel model,
                  const Information& prior) {
  const double radius_sigma_m = tube.quality.radius_sigma_m;
  for (const double gate_radii : {0.2, 0.1}) {
    tube.pixels = predict_pixels(map, config.noise, model);
    const auto observations = observe(map, config, tube, tube.pixels, gate_radii * model.radius_m);
    FitOptions options = fit_options(config, tube, &prior);
    options.gauss_newton_steps = 1;
    options.want_covariance = gate_radii < 0.15;
    auto quality = fit_tube(model, observations, options);
    if (!quality) return false;
    tube.quality = std::move(*quality);
  }
  tube.model = std::move(model);
  if (tube.held_radius_m) {
    tube.quality.radius_sigma_m = radius_sigma_m;
  } else if (!config.radius_m) {
    // The radius may be known no better than to a few parts in ten thousand: no tube is rounder.
    const double floor_m = 3e-4 * tube.model.radius_m;
    tube.quality.radius_sigma_m = std::hypot(tube.quality.radius_sigma_m, floor_m);
    tube.radius_information = inverse(tube.quality.radius_sigma_m * tube.quality.radius_sigma_m);
  }
  return true;
}

bool agrees(const Station& station) {
  return station.expected > 0 && 2 * station.agree >= station.expected;
}

/// Something nearer hides it.
bool covered(const Station& station) {
  return 2 * station.before > station.expected;
}

/// Nothing can be said: out of the picture, without a return, or behind something nearer.
bool hidden(const Station& station) {
  const int unseen = station.expected - station.agree - station.before - station.behind;
  return station.expected == 0 || 2 * (station.before + unseen) > station.expected;
}

/// Lengthens the extent by what is surely seen; shortens it to what is seen, or hidden by something nearer.
Extent confirmed_extent(const std::vector<Station>& stations, const Extent& before) {
  if (stations.size() < 2) return {};
  const double half = 0.5 * (stations[1].t - stations[0].t);
  const auto last_index = static_cast<int>(stations.size()) - 1;
  const auto at = [&](int i) -> const Station& { return stations[static_cast<std::size_t>(i)]; };
  const auto index_of = [&](double t) {
    return std::clamp(static_cast<int>(std::floor((t - stations[0].t) / (2.0 * half) + 0.5)), 0, last_index);
  };
  int first = index_of(before.t_begin + half);
  int last = index_of(before.t_end - half);
  if (first > last) return {};
  // A few pixels agree by chance anywhere: a stretch counts when about as many are to be seen as in the middle.
  std::vector<int> expected;
  for (int i = first; i <= last; ++i) expected.push_back(at(i).expected);
  const auto middle = expected.begin() + static_cast<std::ptrdiff_t>(expected.size() / 2);
  std::nth_element(expected.begin(), middle, expected.end());
  const auto sure = [&](int i) {
    return i >= 0 && i <= last_index && at(i).seen() && 3 * at(i).expected > *middle &&
           4 * at(i).agree > 3 * at(i).expected;
  };
  while (sure(first - 1)) --first;
  while (sure(last + 1)) ++last;
  while (first <= last && !at(first).seen() && !covered(at(first))) ++first;
  while (last >= first && !at(last).seen() && !covered(at(last))) --last;
  if (first > last) return {};
  return {at(first).t - half, at(last).t + half};
}

/// A matrix over control points and radius, with so many control points more (or, below 0, fewer) at either end; new
/// ones get `diagonal`.
Eigen::MatrixXd resized(const Eigen::MatrixXd& matrix, int front, int back, double diagonal) {
  if (matrix.rows() == 0) return matrix;
  const Eigen::Index size = matrix.rows() + 3 * (front + back);
  const Eigen::Index from = 3 * std::max(0, -front);
  const Eigen::Index to = 3 * std::max(0, front);
  const Eigen::Index kept = std::min(matrix.rows() - 1 - from, size - 1 - to);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(size, size);
  result.diagonal().setConstant(diagonal);
  result.block(to, to, kept, kept) = matrix.block(from, from, kept, kept);
  result.block(to, size - 1, kept, 1) = matrix.block(from, matrix.cols() - 1, kept, 1);
  result.block(size - 1, to, 1, kept) = matrix.block(matrix.rows() - 1, from, 1, kept);
  result(size - 1, size - 1) = matrix(matrix.rows() - 1, matrix.cols() - 1);
  return result;
}

Information resized(const Information& information, int front, int back) {
  Information result{resized(information.matrix, front, back, 0.0), {}};
  const Eigen::VectorXd& old = information.vector;
  result.vector = Eigen::VectorXd::Zero(result.matrix.rows());
  if (old.size() == 0) return result;
  const Eigen::Index from = 3 * std::max(0, -front);
  const Eigen::Index to = 3 * std::max(0, front);
  const Eigen::Index kept = std::min(old.size() - 1 - from, result.vector.size() - 1 - to);
  result.vector.segment(to, kept) = old.segment(from, kept);
  result.vector[result.vector.size() - 1] = old[old.size() - 1];
  return result;
}

/// Grows the spline where the tube reaches its end, and drops what is far beyond the extent. All that is indexed by
/// control points or t goes with it.
void fit_spline_to_extent(FollowedTube& tube) {
  auto& q = tube.model.spline.control_m;
  int front = 0;
  int back = 0;
  while (q.size() > 6 && tube.model.spline.spans() - tube.extent.t_end > 2.5) {
    q.pop_back();
    --back;
  }
  while (q.size() > 6 && tube.extent.t_begin > 2.5) {
    q.erase(q.begin());
    --front;
    tube.extent.t_begin -= 1.0;
    tube.extent.t_end -= 1.0;
  }
  if (tube.model.spline.spans() - tube.extent.t_end < 1.0) {
    extend(tube.model.spline, false, true);
    ++back;
  }
  if (tube.extent.t_begin < 1.0) {
    extend(tube.model.spline, true, false);
    ++front;
    tube.extent.t_begin += 1.0;
    tube.extent.t_end += 1.0;
  }
  if (front == 0 && back == 0) return;
  const double far2 = tube.model.radius_m * tube.model.radius_m;
  tube.pooled = resized(tube.pooled, front, back);
  tube.quality.observed = resized(tube.quality.observed, front, back);
  tube.quality.covariance = resized(tube.quality.covariance, front, back, far2);
  tube.anchor = tube.model;
  start_drift(tube.drift, tube.model);
}

/// Pixels and stations of the present model, and what they say of its extent, support and state.
void look(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  tube.pixels = predict_pixels(map, config.noise, tube.model);
  const double station_m = station_length_m(map, tube.model);
  tube.stations = stations_of(map, tube.model, tube.pixels, station_m);
  const Extent extent = confirmed_extent(tube.stations, tube.extent);
  int agree = 0, expected = 0, seen = 0, unknown = 0, all = 0;
  for (const Station& station : tube.stations) {
    if (station.t < extent.t_begin || station.t > extent.t_end) continue;
    ++all;
    unknown += hidden(station) ? 1 : 0;
    if (!agrees(station)) continue;
    ++seen;
    agree += station.agree;
    expected += station.expected;
  }
  tube.support = expected > 0 ? static_cast<double>(agree) / expected : 0.0;
  const bool enough = seen * station_m >= std::max(tube.model.radius_m, 0.010) && tube.support > 0.7;
  if (enough) tube.extent = extent;
  tube.state = enough ? TubeState::tracked : 2 * unknown > all && all > 0 ? TubeState::occluded : TubeState::lost;
}

/// Goes on along what the image confirms until there is no more, or none without a bend that no tube has.
void lengthen(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  constexpr int kMaxRounds = 40;
  int stalled = 0;
  for (int round = 0; round < kMaxRounds && stalled < 3; ++round) {
    FollowedTube longer = tube;
    fit_spline_to_extent(longer);
    if (!fit_to_frame(longer, map, config, longer.model, no_information(longer.model))) return;
    look(longer, map, config);
    if (longer.state != TubeState::tracked) return;
    if (min_bend_radii(longer.model, longer.extent) < config.min_bend_radii) return;
    const double gain = (longer.extent.t_end - longer.extent.t_begin) - (tube.extent.t_end - tube.extent.t_begin);
    tube = std::move(longer);
    stalled = gain < 0.3 ? stalled + 1 : 0;
  }
}

}  // namespace

FollowedTube start_following(FoundTube found, const HeightMap& map, const TrackerConfig& config, double timestamp_s,
                             std::int64_t id) {
  FollowedTube tube;
  tube.id = id;
  tube.model = std::move(found.model);
  tube.extent = found.extent;
  tube.held_radius_m = found.held_radius_m;
  tube.quality = std::move(found.quality);
  tube.support = found.evidence.support;
  tube.pixels = std::move(found.pixels);
  tube.stations = stations_of(map, tube.model, tube.pixels, station_length_m(map, tube.model));
  // A little more at an end may be the foot of a can or the table that it stands on; much more is tube.
  FollowedTube longer = tube;
  lengthen(longer, map, config);
  const auto length_m = [](const FollowedTube& of) {
    return (of.extent.t_end - of.extent.t_begin) * kKnotSpacingRadii * of.model.radius_m;
  };
  if (found.joined || length_m(longer) - length_m(tube) > 2.0 * tube.model.radius_m) tube = std::move(longer);
  tube.last_seen_s = timestamp_s;
  tube.radius_information = inverse(tube.quality.radius_sigma_m * tube.quality.radius_sigma_m);
  start_pool(tube);
  tube.pooled = no_information(tube.model);  // the radius is in what was observed
  add_to_pool(tube);
  return tube;
}

void follow_tube(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, double timestamp_s,
                 double elapsed_s) {
  fit_spline_to_extent(tube);
  if (tube.at_rest) creep_on(tube, elapsed_s);
  TubeModel expected = tube.model;
  if (!tube.at_rest) move(expected, Twist{tube.velocity.shift_m_s, tube.velocity.turn_rad_s} * elapsed_s);
  const FollowedTube before = tube;
  TubeModel model = expected;
  const bool placed = judge_motion(tube, map, config, model, elapsed_s);
  const bool fitted =
      placed && fit_to_frame(tube, map, config, std::move(model), tube.at_rest ? tube.pooled : radius_only(tube));
  look(tube, map, config);
  if (!fitted && tube.state == TubeState::tracked) tube.state = TubeState::lost;
  if (tube.state != TubeState::tracked) {
    const TubeState state = tube.state;
    auto pixels = std::move(tube.pixels);
    auto stations = std::move(tube.stations);
    tube = before;
    tube.model = std::move(expected);
    tube.state = state;
    tube.pixels = std::move(pixels);
    tube.stations = std::move(stations);
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
}

void transform(FollowedTube& tube, const Eigen::Isometry3d& new_from_old) {
  const auto move_model = [&](TubeModel& model) {
    for (Eigen::Vector3d& control : model.spline.control_m) control = new_from_old * control;
  };
  move_model(tube.model);
  move_model(tube.anchor);
  move_model(tube.drift.anchor);
  const Eigen::Matrix3d rotation = new_from_old.linear();
  const auto turn_blocks = [&](Eigen::MatrixXd& matrix) {
    for (Eigen::Index k = 0; k + 3 <= matrix.rows(); k += 3) {
      matrix.middleRows<3>(k) = rotation * Eigen::MatrixXd(matrix.middleRows<3>(k));
    }
    for (Eigen::Index k = 0; k + 3 <= matrix.cols(); k += 3) {
      matrix.middleCols<3>(k) = Eigen::MatrixXd(matrix.middleCols<3>(k)) * rotation.transpose();
    }
  };
  const auto carry = [&](Information& information) {
    turn_blocks(information.matrix);
    Eigen::VectorXd shift = Eigen::VectorXd::Zero(information.vector.size());
    for (Eigen::Index k = 0; k + 3 <= shift.size(); k += 3) {
      information.vector.segment<3>(k) = rotation * Eigen::Vector3d(information.vector.segment<3>(k));
      shift.segment<3>(k) = new_from_old.translation();
    }
    information.vector += information.matrix * shift;
  };
  carry(tube.pooled);
  carry(tube.quality.observed);
  turn_blocks(tube.quality.covariance);
  turn(tube.drift, rotation);
  tube.velocity.shift_m_s = rotation * tube.velocity.shift_m_s;
  tube.velocity.turn_rad_s = rotation * tube.velocity.turn_rad_s;
}

}  // namespace tubetrack
