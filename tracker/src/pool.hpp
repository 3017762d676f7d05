#pragma once

#include "tubetrack/tracker/follow.hpp"

namespace tubetrack {

// What a followed tube keeps of its frames: Information of all of them while it rests, of its radius while it moves.

Information no_information(const TubeModel& model);

/// 1/σ²; 0 for a σ of 0, which says that nothing is known.
inline double information_of(double sigma) {
  return sigma > 0.0 ? 1.0 / (sigma * sigma) : 0.0;
}

/// What earlier frames say of the radius, and nothing of the place.
Information radius_only(const FollowedTube& tube);

/// From now on the tube rests; nothing but its radius is known.
void start_pool(FollowedTube& tube);

/// Takes in what the last fit observed.
void add_to_pool(FollowedTube& tube);

/// The same of a varying radius. In motion every frame stands for itself: a tube that slides along itself takes its
/// profile along, unseen.
void add_to_profile_pool(FollowedTube& tube);

/// At rest, before a frame: what is known of the tube goes on as it creeps.
void creep_on(FollowedTube& tube, double elapsed_s);

/// At rest, after a frame: how fast the tube creeps, seen over all frames pooled. A creeping tube is where the pool's
/// mean frame saw it, and as much farther as it crept since; not knowing that to the end makes the place less sure.
void judge_creep(FollowedTube& tube);

}  // namespace tubetrack
