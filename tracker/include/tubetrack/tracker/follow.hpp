#pragma once

#include <cstdint>
#include <optional>

#include "tubetrack/tracker/grow.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// A shift and turn a second, of a tube as a whole.
struct TubeVelocity {
  Eigen::Vector3d shift_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn_rad_s = Eigen::Vector3d::Zero();
};

/// What the frames that are pooled say of the tube's motion as a whole against an anchor that is carried on with it, as
/// sums over the frames: information of (shift, turn, radius), that times each frame's age and its square, and
/// information times what was seen.
struct Drift {
  using Matrix7 = Eigen::Matrix<double, 7, 7>;
  using Vector7 = Eigen::Matrix<double, 7, 1>;
  TubeModel anchor;
  Matrix7 information = Matrix7::Zero();
  Matrix7 by_age = Matrix7::Zero();
  Matrix7 by_age2 = Matrix7::Zero();
  Vector7 seen = Vector7::Zero();
  Vector7 seen_by_age = Vector7::Zero();
};

/// Spans at either end of an extent.
struct EndTrim {
  double at_begin = 0.0;
  double at_end = 0.0;
};

/// A tube that is followed from frame to frame. Everything is in the camera frame of the last frame.
struct FollowedTube {
  std::int64_t id = 0;
  TubeState state = TubeState::tracked;
  TubeModel model;
  Extent extent;
  EndTrim trim;  ///< so much of the extent is not fitted
  FitQuality quality;
  double support = 0.0;              ///< agreeing pixels over expected ones, where it is seen
  double taper_information = 0.0;    ///< of all looks at its taper (change of radius per length), and
  double taper_sum = 0.0;            ///< information times what each showed
  RecycledVector<Station> stations;  ///< over the whole spline, of the last frame that was fitted
  PredictedPixels pixels;            ///< the same
  TubeModel predicted;               ///< whose pixels they are, in that frame's camera frame
  double last_seen_s = 0.0;
  int frames_followed = 0;  ///< in sight
  int standing = 0;         ///< how surely it is a tube: up with every frame that says so, down with one that denies it
  bool confirmed = false;   ///< only then is it reported

  // While it rests, frames are pooled; while it moves, only the radius is.
  bool at_rest = true;
  Information pooled;                   ///< at rest: of all frames since it came to rest
  int frames_pooled = 0;                ///< at rest: how many; moving: frames since `anchor`
  Drift drift;                          ///< at rest: of the same frames
  std::optional<double> held_radius_m;  ///< as FoundTube's
  double radius_information = 0.0;      ///< 1/m²
  ProfileInformation profile_pool;      ///< at rest, of a varying radius: of the same frames as `pooled`
  TubeModel anchor;                     ///< moving: where it was when it was last asked whether it still moves
  TubeVelocity velocity;                ///< of the motion, or at rest of the creeping
};

/// A tube just found, as the first frame of a followed one; if it was joined, lengthened along all that the image
/// confirms.
FollowedTube start_following(FoundTube found, const HeightMap& map, const TrackerConfig& config, double timestamp_s,
                             std::int64_t id);

/// Leaves the ends of a tube just found out of its pool: they may have bent it into a hook, which would stay there for
/// good. Of what is no longer than 8 radii they are too large a part to do without.
void pool_without_ends(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config);

/// Finds a known tube in the next frame, `elapsed_s` after the last: where it should be, the motion that the frame asks
/// for, whether it rests, a fit with what earlier frames say, and how far the image confirms it now. Sets `state`:
/// `occluded` where something nearer hides it, `lost` where it is not there; both keep the predicted model.
void follow_tube(FollowedTube& tube, const HeightMap& map, const TrackerConfig& config, double timestamp_s,
                 double elapsed_s);

/// Carries a tube, its information and its velocity into another camera frame.
void transform(FollowedTube& tube, const Eigen::Isometry3d& new_from_old);

}  // namespace tubetrack
