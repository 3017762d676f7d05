#include "envelope_cholesky.hpp"

#include <algorithm>
#include <cmath>

namespace tubetrack {

std::optional<EnvelopeCholesky> factor_envelope(const Eigen::MatrixXd& matrix) {
  const Eigen::Index size = matrix.rows();
  EnvelopeCholesky factor;
  factor.lower.resize(size, size);
  factor.first.resize(static_cast<std::size_t>(size));
  auto& lower = factor.lower;
  for (Eigen::Index i = 0; i < size; ++i) {
    Eigen::Index first = 0;
    // The matrix is symmetric: its columns lie together in memory.
    while (first < i && matrix(first, i) == 0.0) ++first;
    factor.first[static_cast<std::size_t>(i)] = first;
    double pivot = matrix(i, i);
    for (Eigen::Index j = first; j < i; ++j) {
      double sum = matrix(j, i);
      for (Eigen::Index k = std::max(first, factor.first[static_cast<std::size_t>(j)]); k < j; ++k) {
        sum -= lower(i, k) * lower(j, k);
      }
      lower(i, j) = sum / lower(j, j);
      pivot -= lower(i, j) * lower(i, j);
    }
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return std::nullopt;
    lower(i, i) = std::sqrt(pivot);
  }
  return factor;
}

Eigen::VectorXd solve(const EnvelopeCholesky& factor, Eigen::VectorXd right) {
  const auto& lower = factor.lower;
  for (Eigen::Index i = 0; i < right.size(); ++i) {
    for (Eigen::Index k = factor.first[static_cast<std::size_t>(i)]; k < i; ++k) right[i] -= lower(i, k) * right[k];
    right[i] /= lower(i, i);
  }
  for (Eigen::Index i = right.size(); i-- > 0;) {
    right[i] /= lower(i, i);
    for (Eigen::Index k = factor.first[static_cast<std::size_t>(i)]; k < i; ++k) right[k] -= lower(i, k) * right[i];
  }
  return right;
}

Eigen::MatrixXd inverse_of(const EnvelopeCholesky& factor) {
  const auto& lower = factor.lower;
  const Eigen::Index size = lower.rows();
  // Solves for all unit vectors at once. The result is symmetric, so row i is only carried up to its diagonal; as a
  // column of the transposed matrix, it lies together in memory.
  Eigen::MatrixXd rows = Eigen::MatrixXd::Identity(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index k = factor.first[static_cast<std::size_t>(i)]; k < i; ++k) {
      rows.col(i).head(k + 1) -= lower(i, k) * rows.col(k).head(k + 1);
    }
    rows.col(i).head(i + 1) /= lower(i, i);
  }
  for (Eigen::Index i = size; i-- > 0;) {
    rows.col(i).head(i + 1) /= lower(i, i);
    for (Eigen::Index k = factor.first[static_cast<std::size_t>(i)]; k < i; ++k) {
      rows.col(k).head(k + 1) -= lower(i, k) * rows.col(i).head(k + 1);
    }
  }
  rows.triangularView<Eigen::StrictlyLower>() = rows.transpose();
  return rows;
}

}  // namespace tubetrack
