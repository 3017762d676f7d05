#pragma once

#include "normal_equations.hpp"
#include "tubetrack/heightmap/height_map.hpp"
#include "tubetrack/tracker/follow.hpp"

namespace tubetrack {

// How a followed tube is fitted to one frame, step by step. All is in the camera frame.

/// Radii: how near a reading must be to be fitted, beside its noise.
inline constexpr double kFitGate = 0.1;

/// Predicts the pixels of a model, for the tube to keep.
void predict(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, const TubeModel& model);

/// Has a model moved from the one whose pixels were predicted, by more than a fiftieth of the radius?
bool is_stale(const FollowedTube& tube, const TubeModel& model);

/// What the frame says of a model whose pixels the tube has: those near it, which are fitted, and all about it, by
/// which it is found again.
struct FrameView {
  ObservedEquations near, all;
  SortedObservations readings;  ///< those near it, where the radius may vary
};

/// Of the stretch that is known, short of ends that may show their face (`EndTrim`). `all` is empty where far_radii is
/// no more than near_radii.
FrameView view_of(const FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, const TubeModel& model,
                  double near_radii, double far_radii);

/// One step from a model that is near, to `model` and the tube's `quality`. False where it breaks down.
bool fit_once(FollowedTube& tube, const TrackerConfig& config, TubeModel& model, FrameView view,
              const Information& prior, const ProfileInformation* profile_prior, bool want_covariance);

/// The fitted model becomes the tube's.
void take_model(FollowedTube& tube, TubeModel model, const TrackerConfig& config);

/// Two steps, for a model that may be farther off. False where they break down: the tube keeps its model.
bool fit_to_frame(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, TubeModel model);

/// What the tube's pixels, which are predicted, say of its stations, extent, support and state.
void look(FollowedTube& tube, const HeightMap& map);

}  // namespace tubetrack
