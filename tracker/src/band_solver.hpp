#pragma once

#include <Eigen/Core>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// The lower half of a symmetric matrix as normal equations have it: each control point (three rows) is tied to the
/// three before and behind it, and the last row, a radius, to all. What is outside of that is zero, and not held.
class BandMatrix {
 public:
  BandMatrix() = default;
  /// All zero; `rows` is 3 n + 1.
  explicit BandMatrix(Eigen::Index rows);
  /// Only the band and the last row of the lower half are read.
  explicit BandMatrix(const RecycledMatrix& dense);

  Eigen::Index rows() const { return rows_; }
  /// The first column of a row's part of the band; behind the last row of a column's part of it, the last row apart.
  Eigen::Index first_in(Eigen::Index row) const;
  Eigen::Index end_in(Eigen::Index col) const;
  /// A row's entries by their columns.
  double* row(Eigen::Index row) { return entries_.data() + offset_of(row); }
  const double* row(Eigen::Index row) const { return entries_.data() + offset_of(row); }
  double at(Eigen::Index a, Eigen::Index b) const { return a >= b ? row(a)[b] : row(b)[a]; }

  /// Adds what ties a control point to itself or an earlier one: its three rows, the other's three columns.
  void add(std::size_t point, std::size_t to, const Eigen::Matrix3d& block) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      double* const own = row(static_cast<Eigen::Index>(3 * point) + i) + 3 * to;
      for (Eigen::Index j = 0; j < 3; ++j) own[j] += block(i, j);
    }
  }
  Eigen::Matrix3d block(std::size_t point, std::size_t to) const;
  BandMatrix& operator*=(double factor);

 private:
  static constexpr Eigen::Index kWidth = 12;

  Eigen::Index offset_of(Eigen::Index row) const {
    return kWidth * row - (row + 1 == rows_ ? 0 : row - row % 3 - (kWidth - 3));
  }

  Eigen::Index rows_ = 0;
  RecycledVector<double> entries_;
};

/// LDLᵀ of such a matrix, positive definite. Nothing fills in, so time grows with the size alone.
class BandSolver {
 public:
  explicit BandSolver(const BandMatrix& matrix);
  explicit BandSolver(const RecycledMatrix& matrix) : BandSolver(BandMatrix(matrix)) {}

  /// False where the matrix is not positive definite; then there is no solution.
  bool ok() const { return ok_; }
  RecycledColumn solve(const RecycledColumn& right) const;
  /// The inverse's last entry, of the radius.
  double inverse_of_last() const { return 1.0 / diagonal_[diagonal_.size() - 1]; }
  /// The inverse inside the band and in the last row and column (Takahashi's recurrence: an entry of the inverse where
  /// the factor has one depends on others of that kind alone).
  BandMatrix inverse_band() const;
  /// The same with zeros elsewhere.
  RecycledMatrix inverse_in_band() const;

 private:
  BandMatrix lower_;
  RecycledColumn diagonal_;
  bool ok_ = false;
};

}  // namespace tubetrack
