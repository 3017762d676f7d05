#include "band_solver.hpp"

#include <algorithm>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

using Eigen::Index;

/// The first column of a row's part of the band.
Index BandSolver::first_in(Index row) const {
  return row + 1 == lower_.rows() ? 0 : std::max<Index>(0, row - row % 3 - 9);
}

/// Behind the last row of a column's part of the band, the last row of all apart.
Index BandSolver::end_in(Index col) const {
  return std::min(lower_.rows() - 1, col - col % 3 + 12);
}

BandSolver::BandSolver(const RecycledMatrix& matrix) : lower_(matrix.rows(), matrix.rows()), diagonal_(matrix.rows()) {
  for (Index row = 0; row < matrix.rows(); ++row) {
    double* const own = &lower_(row, 0);  // times the diagonal until the row is done
    const Index first = first_in(row);
    double rest = matrix(row, row);
    for (Index col = first; col < row; ++col) {
      const double* const other = &lower_(col, 0);
      double sum = matrix(row, col);
      for (Index k = std::max(first, first_in(col)); k < col; ++k) sum -= own[k] * other[k];
      own[col] = sum;
    }
    for (Index col = first; col < row; ++col) {
      const double value = own[col] / diagonal_[col];
      rest -= own[col] * value;
      own[col] = value;
    }
    if (!(rest > 0.0)) return;
    diagonal_[row] = rest;
  }
  ok_ = true;
}

RecycledColumn BandSolver::solve(const RecycledColumn& right) const {
  const Index size = lower_.rows();
  RecycledColumn x = right;
  for (Index row = 0; row < size; ++row) {
    for (Index col = first_in(row); col < row; ++col) x[row] -= lower_(row, col) * x[col];
  }
  x.array() /= diagonal_.array();
  for (Index row = size - 1; row >= 0; --row) {
    for (Index col = first_in(row); col < row; ++col) x[col] -= lower_(row, col) * x[row];
  }
  return x;
}

RecycledMatrix BandSolver::inverse_in_band() const {
  const Index size = lower_.rows();
  const Index last = size - 1;
  RecycledMatrix inverse = Eigen::MatrixXd::Zero(size, size);
  inverse(last, last) = 1.0 / diagonal_[last];
  for (Index col = last - 1; col >= 0; --col) {
    const Index end = end_in(col);
    const auto entry = [&](Index row) {
      double sum = -lower_(last, col) * inverse(last, row);
      for (Index other = col + 1; other < end; ++other) sum -= lower_(other, col) * inverse(other, row);
      inverse(row, col) = inverse(col, row) = sum;
      return lower_(row, col) * sum;
    };
    double own = 1.0 / diagonal_[col] - entry(last);
    for (Index row = col + 1; row < end; ++row) own -= entry(row);
    inverse(col, col) = own;
  }
  return inverse;
}

}  // namespace tubetrack
