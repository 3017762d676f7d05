#include "band_solver.hpp"

#include <algorithm>

namespace tubetrack {

namespace {

/// With all of the band, be it zero, so that the factor has it too.
Eigen::SparseMatrix<double> lower_band(const Eigen::MatrixXd& matrix) {
  const Eigen::Index size = matrix.rows();
  const Eigen::Index last = size - 1;
  Eigen::SparseMatrix<double> band(size, size);
  band.reserve(13 * size);
  for (Eigen::Index col = 0; col < size; ++col) {
    band.startVec(col);
    const Eigen::Index end = std::min(last, col - col % 3 + 12);
    for (Eigen::Index row = col; row < end; ++row) band.insertBack(row, col) = matrix(row, col);
    band.insertBack(last, col) = matrix(last, col);
  }
  band.finalize();
  return band;
}

}  // namespace

BandSolver::BandSolver(const Eigen::MatrixXd& matrix) {
  factor_.compute(lower_band(matrix));
  ok_ = factor_.info() == Eigen::Success && factor_.vectorD().minCoeff() > 0.0;
}

Eigen::MatrixXd BandSolver::inverse_in_band() const {
  const Eigen::SparseMatrix<double>& lower = factor_.matrixL().nestedExpression();
  const Eigen::VectorXd diagonal = factor_.vectorD();
  const Eigen::Index size = diagonal.size();
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index col = size - 1; col >= 0; --col) {
    using Entry = Eigen::SparseMatrix<double>::InnerIterator;
    double own = 1.0 / diagonal[col];
    for (Entry row(lower, col); row; ++row) {
      if (row.row() <= col) continue;
      double sum = 0.0;
      for (Entry other(lower, col); other; ++other) {
        if (other.row() > col) sum -= other.value() * inverse(other.row(), row.row());
      }
      inverse(row.row(), col) = inverse(col, row.row()) = sum;
      own -= row.value() * sum;
    }
    inverse(col, col) = own;
  }
  return inverse;
}

}  // namespace tubetrack
