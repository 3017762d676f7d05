#include "tubetrack/tracker/associate.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "confidence.hpp"
#include "hide.hpp"
#include "motion.hpp"
#include "shape_sums.hpp"
#include "tubetrack/tracker/join.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

constexpr double kForgetLost_s = 1.0;
constexpr double kForgetHidden_s = 3.0;
constexpr int kFramesOnTrial = 10;
constexpr int kFramesBetweenTrials = 8;
constexpr int kBestStanding = 20;  // ten frames beside a hand do not undo it
constexpr double kSureTaper = 0.02;
constexpr double kConfirming = 0.85;
constexpr double kShort = 5.0;  // diameters
constexpr int kConfirmingFrames = 2, kConfirmingFramesOfShort = 8;
constexpr double kHook = 0.4;  // spans
constexpr double kFastest_m_s = 0.75;

RecycledVector<Eigen::Vector3d> samples_of(const TubeModel& model, const Extent& extent) {
  constexpr int kSamples = 20;
  RecycledVector<Eigen::Vector3d> points;
  for (int i = 0; i <= kSamples; ++i) {
    points.push_back(point_at(model.spline, extent.t_begin + (extent.t_end - extent.t_begin) * i / kSamples));
  }
  return points;
}

/// Mean distance from one line's samples to the other's nearest.
double distance_m(const RecycledVector<Eigen::Vector3d>& from, const RecycledVector<Eigen::Vector3d>& to) {
  double sum = 0.0;
  for (const Eigen::Vector3d& point : from) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& other : to) nearest = std::min(nearest, (point - other).squaredNorm());
    sum += std::sqrt(nearest);
  }
  return sum / static_cast<double>(from.size());
}

/// Can the found tube be the one that went out of sight? How far it would have come, or nothing: from where it was
/// expected by its last velocity, or from where it was seen last, as it may have stopped or turned back unseen.
std::optional<double> way_back_m(const FollowedTube& missing, const FoundTube& found, double timestamp_s) {
  const double sigma = std::hypot(missing.quality.radius_sigma_m, found.quality.radius_sigma_m);
  const double off = std::abs(missing.model.radius_m - found.model.radius_m);
  const double varies_m = std::max(spread_m(missing.model.profile), spread_m(found.model.profile));
  if (off > 4.0 * sigma + 0.05 * missing.model.radius_m + varies_m) return std::nullopt;
  const double away_s = std::max(0.0, timestamp_s - missing.last_seen_s);
  TubeModel last_seen = missing.model;
  move(last_seen, during(missing.velocity, -away_s));
  const auto new_line = samples_of(found.model, found.extent);
  // A part of a tube is that tube: the shorter line decides.
  const auto way_from = [&](const TubeModel& old) {
    const auto old_line = samples_of(old, missing.extent);
    return std::min(distance_m(old_line, new_line), distance_m(new_line, old_line));
  };
  const double way = std::min(way_from(missing.model), way_from(last_seen));
  if (way > 2.0 * missing.model.radius_m + kFastest_m_s * away_s) return std::nullopt;
  return way;
}

/// Which of the tubes out of sight is back; the nearest.
std::optional<std::size_t> recognise(const KnownTubes& known, const FoundTube& found, double timestamp_s) {
  std::optional<std::size_t> best;
  double best_way = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < known.tubes.size(); ++i) {
    if (known.tubes[i].state == TubeState::tracked) continue;
    const auto way = way_back_m(known.tubes[i], found, timestamp_s);
    if (!way || *way >= best_way) continue;
    best_way = *way;
    best = i;
  }
  return best;
}

FoundTube as_found(const FollowedTube& tube, const HeightMap& map, const TrackerConfig& config) {
  FoundTube found{tube.model, tube.extent, tube.quality, {}, tube.pixels, tube.held_radius_m};
  found.evidence = gather_evidence(map, config.noise, tube.model, tube.pixels, tube.extent);
  return found;
}

/// What tells where a tube runs and how thick it is. What the image says of it costs as much as a fit.
FoundTube without_evidence(const FollowedTube& tube) {
  FoundTube found{tube.model, tube.extent, {}, {}, {}, tube.held_radius_m};
  found.quality.radius_sigma_m = tube.quality.radius_sigma_m;
  found.evidence.length_m = arc_length_m(tube.model.spline, tube.extent.t_begin, tube.extent.t_end);
  return found;
}

/// Joins pieces among themselves until no two belong together.
void join_all(RecycledVector<FoundTube>& found, const HeightMap& map, const TrackerConfig& config) {
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t j = i + 1; j < found.size(); ++j) {
      auto joined = join_pieces(map, config, found[i], found[j]);
      if (!joined) continue;
      found[i] = std::move(*joined);
      found.erase(found.begin() + static_cast<std::ptrdiff_t>(j));
      j = i;
    }
  }
}

/// What was found takes the place of a known tube, with its id and standing.
void go_on_from(FollowedTube& tube, FoundTube found, const HeightMap& map, const TrackerConfig& config,
                double timestamp_s) {
  const int frames_followed = tube.frames_followed;
  const int standing = tube.standing;
  const bool confirmed = tube.confirmed;
  tube = start_following(std::move(found), map, config, timestamp_s, tube.id);
  pool_without_ends(tube, map, config);
  tube.frames_followed = frames_followed;
  tube.standing = standing;
  tube.confirmed = confirmed;
}

/// Joins a piece to a known tube in sight.
bool join_to_known(KnownTubes& known, const FoundTube& piece, const HeightMap& map, const TrackerConfig& config,
                   double timestamp_s) {
  for (FollowedTube& tube : known.tubes) {
    if (tube.state != TubeState::tracked || !run_on(without_evidence(tube), piece)) continue;
    auto joined = join_pieces(map, config, as_found(tube, map, config), piece);
    if (!joined) continue;
    go_on_from(tube, std::move(*joined), map, config, timestamp_s);
    return true;
  }
  return false;
}

/// The tube that was out of sight goes on where it was found, at the speed that took it there.
void come_back(FollowedTube& tube, FoundTube found, const HeightMap& map, const TrackerConfig& config,
               double timestamp_s) {
  const auto middle = [](const TubeModel& model, const Extent& extent) {
    return point_at(model.spline, 0.5 * (extent.t_begin + extent.t_end));
  };
  const double away_s = timestamp_s - tube.last_seen_s;
  // Along the tube the two extents may differ: only what is across it is motion.
  const Eigen::Vector3d along = derivative_at(found.model.spline, 0.5 * found.model.spline.spans()).normalized();
  const Eigen::Vector3d way = middle(found.model, found.extent) - middle(tube.model, tube.extent);
  const Eigen::Vector3d across = way - way.dot(along) * along;
  const bool brief = away_s > 0.0 && away_s < 0.15;
  const double radius_information = tube.radius_information;
  const double radius_m = tube.model.radius_m;
  go_on_from(tube, std::move(found), map, config, timestamp_s);
  // The radius known from before counts on, at rest and in motion.
  const double sum = tube.radius_information + radius_information;
  const bool one_radius = tube.model.profile.offset_m.empty();
  if (one_radius && radius_information > 0.0 && tube.radius_information > 0.0) {
    tube.model.radius_m = (tube.radius_information * tube.model.radius_m + radius_information * radius_m) / sum;
    tube.radius_information = sum;
    const Eigen::Index last = tube.pooled.vector.size() - 1;
    tube.pooled.matrix(last, last) += radius_information;
    tube.pooled.vector[last] += radius_information * radius_m;
  }
  if (brief && across.norm() > 0.5 * tube.model.radius_m) {
    tube.at_rest = false;
    tube.frames_pooled = 0;
    tube.anchor = tube.model;
    tube.velocity.shift_m_s = across / away_s;
  }
}

/// Can one frame tell it from a finger or a forearm? Of these a short piece shows little taper, or turns at a joint.
bool sure_at_once(const TubeModel& model, const Extent& extent, const Evidence& e) {
  const double length_radii = e.length_m / model.radius_m;
  // The ends are left out: their own faces, or what they stand on, bend a fit into a hook.
  const double bend_radii = min_bend_radii(model, {extent.t_begin + kHook, extent.t_end - kHook});
  const bool turns = length_radii < 3.8 && bend_radii < 6.5 && length_radii / bend_radii > 0.45;
  return e.taper_sigma < kSureTaper && !turns;
}

/// Starts to follow a tube that was not known, if all that the image confirms of it still says that it is one.
void take_in_fresh(KnownTubes& known, FoundTube found, const HeightMap& map, const TrackerConfig& config,
                   double timestamp_s) {
  Evidence evidence = found.evidence;
  const Extent extent = found.extent;
  FollowedTube fresh = start_following(std::move(found), map, config, timestamp_s, known.next_id);
  // Lengthened along all that the image confirms it may turn out to be none: a forearm's taper shows over its length.
  const bool longer = fresh.extent.t_begin != extent.t_begin || fresh.extent.t_end != extent.t_end;
  if (longer) evidence = gather_evidence(map, config.noise, fresh.model, fresh.pixels, fresh.extent);
  if (why_no_tube(evidence, fresh.model.radius_m, config)) return;
  ++known.next_id;
  fresh.confirmed = known.first_frame && sure_at_once(fresh.model, fresh.extent, evidence);
  fresh.standing = fresh.confirmed ? 2 : 0;
  pool_without_ends(fresh, map, config);
  known.tubes.push_back(std::move(fresh));
}

/// A finger that moves is a tube for a frame or two, but less surely than those that are one (docs/accuracy.md); a
/// forearm is one for more frames, but a short one.
bool is_sure(const FollowedTube& tube, double length_m) {
  const bool is_short = length_m < kShort * 2.0 * tube.model.radius_m;
  return tube.standing >= (is_short ? kConfirmingFramesOfShort : kConfirmingFrames) &&
         confidence_of(tube) > kConfirming;
}

}  // namespace

void take_in(KnownTubes& known, RecycledVector<FoundTube> found, HeightMap& map, const TrackerConfig& config,
             double timestamp_s) {
  std::erase_if(found, [&](const FoundTube& tube) {
    return std::any_of(known.tubes.begin(), known.tubes.end(), [&](const FollowedTube& other) {
      return other.state == TubeState::tracked && same_tube(tube.model, tube.extent, other.model, other.extent);
    });
  });
  join_all(found, map, config);
  HiddenCells hidden;
  for (std::size_t i = 0; i < found.size(); ++i) {
    FoundTube& tube = found[i];
    if (const auto back = recognise(known, tube, timestamp_s)) {
      come_back(known.tubes[*back], std::move(tube), map, config, timestamp_s);
      continue;
    }
    if (join_to_known(known, tube, map, config, timestamp_s)) continue;
    const SeenTube mine = seen(tube);
    hide_others(known.tubes, nullptr, &mine, map, hidden);
    for (std::size_t j = i + 1; j < found.size(); ++j) {
      hide_from(&mine, seen(found[j]), map, hidden);
    }
    hide_beside_gaps(mine, map, hidden);
    take_in_fresh(known, std::move(tube), map, config, timestamp_s);
    show_again(map, hidden);
  }
  known.first_frame = false;
}

void join_known(KnownTubes& known, HeightMap& map, const TrackerConfig& config, double timestamp_s) {
  HiddenCells hidden;
  for (std::size_t i = 0; i < known.tubes.size(); ++i) {
    for (std::size_t j = i + 1; j < known.tubes.size(); ++j) {
      FollowedTube& tube = known.tubes[i];
      const FollowedTube& other = known.tubes[j];
      const bool now = other.frames_followed % kFramesBetweenTrials == kFramesBetweenTrials / 2;
      const bool in_sight = tube.state == TubeState::tracked && other.state == TubeState::tracked;
      if (!now || !in_sight || !in_one_line(tube, other)) continue;
      for (const FollowedTube& third : known.tubes) {
        if (&third != &tube && &third != &other && third.state == TubeState::tracked)
          hide_from(nullptr, seen(third), map, hidden);
      }
      auto joined = join_pieces(map, config, as_found(tube, map, config), as_found(other, map, config));
      if (joined) {
        tube.confirmed = tube.confirmed || other.confirmed;
        go_on_from(tube, std::move(*joined), map, config, timestamp_s);
        known.tubes.erase(known.tubes.begin() + static_cast<std::ptrdiff_t>(j--));
      }
      show_again(map, hidden);
    }
  }
}

void confirm_or_forget(KnownTubes& known, HeightMap& map, const TrackerConfig& config) {
  HiddenCells hidden;
  for (FollowedTube& tube : known.tubes) {
    // Of tubes that were found together not all in one frame.
    const bool its_turn = (tube.frames_followed + tube.id) % kFramesBetweenTrials == 0;
    const bool now = tube.frames_followed <= kFramesOnTrial || its_turn;
    if (tube.state != TubeState::tracked || !now) continue;
    const SeenTube mine = seen(tube);
    hide_others(known.tubes, &tube, &mine, map, hidden);
    const Evidence evidence = gather_evidence(map, config.noise, tube.model, tube.pixels, tube.extent);
    add_look(tube, evidence);
    const bool denied = why_no_tube(evidence, tube.model.radius_m, config).has_value();
    show_again(map, hidden);
    tube.standing = std::min(kBestStanding, tube.standing + (denied ? -2 : 1));
    tube.confirmed = tube.confirmed || is_sure(tube, evidence.length_m);
  }
  std::erase_if(known.tubes, [](const FollowedTube& tube) { return tube.standing < 0; });
}

void forget_old(KnownTubes& known, double timestamp_s) {
  std::erase_if(known.tubes, [&](const FollowedTube& tube) {
    const double away_s = timestamp_s - tube.last_seen_s;
    return tube.state != TubeState::tracked &&
           away_s > (tube.state == TubeState::occluded ? kForgetHidden_s : kForgetLost_s);
  });
}

}  // namespace tubetrack
