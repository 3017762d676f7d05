#pragma once

#include <optional>

#include "stretch_sums.hpp"
#include "tubetrack/tracker/fit.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// `fit_tube` with a radius that varies: the profile's control values in place of the one radius, which takes over
/// their mean where no earlier frame says anything of them.
std::optional<FitQuality> fit_varying_tube(TubeModel& model, const SortedObservations& observations,
                                           const FitOptions& options);

/// Information of a profile in a row of `size` control values, the first of which has the number `first`: they must be
/// among them, or nothing is said.
Information placed(const ProfileInformation& information, int first, Eigen::Index size);

/// What the profile adds to NormalEquations, one row or column a control value: with the centreline's parameters (in
/// Information's order; the radius' row is zero), among themselves, and the right side.
struct ProfileEquations {
  RecycledMatrix shared;
  RecycledMatrix own;
  RecycledColumn right;
  RecycledColumn mean_basis;  ///< weights of the control values in the mean offset over the observations
};
ProfileEquations profile_equations(const TubeModel& model, const RecycledVector<StretchSums>& stretches);

}  // namespace tubetrack
