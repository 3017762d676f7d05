#pragma once

#include <Eigen/Core>
#include <vector>

#include "stretch_sums.hpp"
#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {

/// One Gauss-Newton step: matrix · change = right. Control points first (x, y, z each), the radius last.
struct NormalEquations {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;
  Eigen::MatrixXd observed;        ///< the observations' part of the matrix …
  Eigen::VectorXd observed_right;  ///< … and of the right side
  double chi2 = 0.0;
  int used = 0;  ///< observations whose ray meets the tube well
};

/// Observations, the priors on the centreline's shape and what earlier frames say. With the radius held its row is the
/// identity's.
NormalEquations normal_equations(const TubeModel& model, const SortedObservations& observations,
                                 const FitOptions& options);

/// `residual_of` with the centreline's polynomials at hand; without the basis.
ResidualTerm residual_on(const std::vector<SpanPolynomial>& curve, double radius_m, const Observation& observation);

}  // namespace tubetrack
