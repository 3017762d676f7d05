#pragma once

#include <Eigen/Core>

#include "stretch_sums.hpp"
#include "tubetrack/tracker/fit.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// What observations say, as one Gauss-Newton step from the model would take it: matrix · change = right. Control
/// points first (x, y, z each), the radius last; with the radius held its row and column are zero.
struct ObservedEquations {
  RecycledMatrix matrix;
  RecycledColumn right;
  double chi2 = 0.0;
  int used = 0;  ///< observations whose ray meets the tube well

  ObservedEquations& operator+=(const ObservedEquations& other);
};
ObservedEquations observed_equations(const TubeModel& model, const SortedObservations& observations, bool free_radius);

/// The whole step: with the priors on the centreline's shape and what earlier frames say. With the radius held its row
/// is the identity's.
struct NormalEquations {
  RecycledMatrix matrix;
  RecycledColumn right;
};
NormalEquations normal_equations(const TubeModel& model, const ObservedEquations& observed, const FitOptions& options);

/// `residual_of` with the centreline's polynomials at hand; without the basis.
ResidualTerm residual_on(const RecycledVector<SpanPolynomial>& curve, double radius_m, const Observation& observation);

}  // namespace tubetrack
