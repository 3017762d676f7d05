#pragma once

#include <algorithm>
#include <optional>
#include <span>

#include "tubetrack/tracker/radius_profile.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/spline.hpp"

namespace tubetrack {

/// A tube being fitted: a centreline and one radius, or (`varying_radius`) one that its profile adds to along it.
struct TubeModel {
  Spline spline;
  double radius_m = 0.0;
  RadiusProfile profile = {};
};

/// At a place of the centreline; where a profile that goes on past what is seen would make it vanish, a quarter of the
/// one radius.
inline double radius_at(const TubeModel& model, double t) {
  if (model.profile.offset_m.empty()) return model.radius_m;
  return std::max(0.25 * model.radius_m, model.radius_m + radius_offset_m(model.profile, model.spline, t));
}

/// A measured point, the direction along which it errs (unit: the viewing ray, or the normal for a scan) and by how
/// much. `t` is the place on the centreline that the model expects it at.
struct Observation {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  double sigma_m = 0.001;
  double t = 0.0;
};

/// What observations say of a model, without any prior on its shape, so that frames can be added up: the inverse of the
/// covariance of all control points (x, y, z each) and, last, of the radius, and that matrix times their mean.
struct Information {
  RecycledMatrix matrix;
  RecycledColumn vector;
};

/// What observations say of the control values of a RadiusProfile, whatever the centreline: as Information, over the
/// values alone, the first of which has the number `first`.
struct ProfileInformation {
  int first = 0;
  Information values = {};
};

/// Control points and radius in the order of Information.
RecycledColumn parameters_of(const TubeModel& model);

struct FitOptions {
  std::optional<double> radius_m;  ///< known: held
  double radius_min_m = 0.001;
  double radius_max_m = 1.0;
  int gauss_newton_steps = 2;
  const Information* prior = nullptr;  ///< of the model's size
  bool want_covariance = true;         ///< and what these observations alone say
  double suppleness = 1.0;  ///< how far the line may bend: 1 any tube; small values hold a short seed straight
  /// The radius may vary along the tube; not where it is known, nor below suppleness 1, where a profile stays as it is.
  bool varying_radius = false;
  const ProfileInformation* profile_prior = nullptr;  ///< what earlier frames say of the profile
  bool prior_has_places = false;  ///< `prior` is of those same frames, and holds what they say of the centreline
};

/// What Gauss-Newton says of its result.
struct FitQuality {
  double chi2_per_observation = 0.0;
  double radius_sigma_m = 0.0;
  Information observed;  ///< of these observations alone
  /// Of all control points (x, y, z each) and, last, the radius; inflated by χ² above 1. Of control points that are
  /// more than three apart, which no place of the centreline shares, it says zero.
  RecycledMatrix covariance;
  // Of a varying radius only: `radius_sigma_m` is then that of its mean, and nothing is said of one radius.
  ProfileInformation profile;         ///< what these observations alone say of it
  RecycledMatrix profile_covariance;  ///< of its control values; inflated likewise
};

/// Gauss-Newton on residuals along the observations' directions (paper, section 2.3, equation 1, with the noise where
/// it is), over all control points and the radius at once; set and weights stay as they are. The centreline is smooth
/// in its third difference, which leaves straights and arcs alone. Empty where too little is observed or the fit breaks
/// down.
std::optional<FitQuality> fit_tube(TubeModel& model, std::span<const Observation> observations,
                                   const FitOptions& options);

/// Residual of one observation (metres along its direction: measured − predicted) and its derivatives.
struct ResidualTerm {
  double residual_m = 0.0;
  double t = 0.0;  ///< place on the centreline, in spans
  SplineBasis basis;
  Eigen::Vector3d by_point = Eigen::Vector3d::Zero();  ///< by the centreline's point; × basis.value for a control point
  double by_radius = 0.0;
  bool valid = false;  ///< false where the direction grazes or misses the tube
};
ResidualTerm residual_of(const TubeModel& model, const Observation& observation);

}  // namespace tubetrack
