#include "band_solver.hpp"

#include <algorithm>
#include <array>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

using Eigen::Index;

BandMatrix::BandMatrix(Index rows) : rows_(rows), entries_(static_cast<std::size_t>(kWidth * (rows - 1) + rows), 0.0) {}

BandMatrix::BandMatrix(const RecycledMatrix& dense) : BandMatrix(dense.rows()) {
  for (Index r = 0; r < rows_; ++r) {
    double* const own = row(r);
    for (Index col = first_in(r); col <= r; ++col) own[col] = dense(r, col);
  }
}

Index BandMatrix::first_in(Index row) const {
  return row + 1 == rows_ ? 0 : std::max<Index>(0, row - row % 3 - 9);
}

Index BandMatrix::end_in(Index col) const {
  return std::min(rows_ - 1, col - col % 3 + 12);
}

Eigen::Matrix3d BandMatrix::block(std::size_t point, std::size_t to) const {
  Eigen::Matrix3d block;
  for (Index i = 0; i < 3; ++i) {
    for (Index j = 0; j < 3; ++j) block(i, j) = at(static_cast<Index>(3 * point) + i, static_cast<Index>(3 * to) + j);
  }
  return block;
}

BandMatrix& BandMatrix::operator*=(double factor) {
  for (double& entry : entries_) entry *= factor;
  return *this;
}

BandSolver::BandSolver(const BandMatrix& matrix) : lower_(matrix.rows()), diagonal_(matrix.rows()) {
  for (Index row = 0; row < matrix.rows(); ++row) {
    double* const own = lower_.row(row);  // times the diagonal until the row is done
    const double* const given = matrix.row(row);
    const Index first = lower_.first_in(row);
    double rest = given[row];
    for (Index col = first; col < row; ++col) {
      const double* const other = lower_.row(col);
      double sum = given[col];
      for (Index k = std::max(first, lower_.first_in(col)); k < col; ++k) sum -= own[k] * other[k];
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
    const double* const own = lower_.row(row);
    for (Index col = lower_.first_in(row); col < row; ++col) x[row] -= own[col] * x[col];
  }
  x.array() /= diagonal_.array();
  for (Index row = size - 1; row >= 0; --row) {
    const double* const own = lower_.row(row);
    for (Index col = lower_.first_in(row); col < row; ++col) x[col] -= own[col] * x[row];
  }
  return x;
}

BandMatrix BandSolver::inverse_band() const {
  const Index size = lower_.rows();
  const Index last = size - 1;
  BandMatrix inverse(size);
  inverse.row(last)[last] = inverse_of_last();
  std::array<double, 12> factors{};  // of the column, below it
  for (Index col = last - 1; col >= 0; --col) {
    const Index end = lower_.end_in(col);
    for (Index other = col + 1; other < end; ++other)
      factors[static_cast<std::size_t>(other - col)] = lower_.row(other)[col];
    const auto entry = [&](Index row) {
      double sum = -lower_.row(last)[col] * inverse.at(last, row);
      for (Index other = col + 1; other < end; ++other)
        sum -= factors[static_cast<std::size_t>(other - col)] * inverse.at(other, row);
      inverse.row(row)[col] = sum;
      return lower_.row(row)[col] * sum;
    };
    double own = 1.0 / diagonal_[col] - entry(last);
    for (Index row = col + 1; row < end; ++row) own -= entry(row);
    inverse.row(col)[col] = own;
  }
  return inverse;
}

RecycledMatrix BandSolver::inverse_in_band() const {
  const BandMatrix band = inverse_band();
  RecycledMatrix inverse = Eigen::MatrixXd::Zero(band.rows(), band.rows());
  for (Index row = 0; row < band.rows(); ++row) {
    for (Index col = band.first_in(row); col <= row; ++col) inverse(row, col) = inverse(col, row) = band.row(row)[col];
  }
  return inverse;
}

}  // namespace tubetrack
