#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace tubetrack {

/// A = L Lᵀ, row by row from each row's first entry that is not zero: L has none before it either. The normal equations
/// of a spline are a band of twelve and one full row, which makes this linear in their size.
struct EnvelopeCholesky {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> lower;  ///< set from `first` to the diagonal
  std::vector<Eigen::Index> first;
};

/// Empty where the matrix (its lower half is read) is not positive definite or not finite.
std::optional<EnvelopeCholesky> factor_envelope(const Eigen::MatrixXd& matrix);

Eigen::VectorXd solve(const EnvelopeCholesky& factor, Eigen::VectorXd right);

/// All of the inverse, which is full.
Eigen::MatrixXd inverse_of(const EnvelopeCholesky& factor);

}  // namespace tubetrack
