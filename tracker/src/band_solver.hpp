#pragma once

#include <Eigen/Core>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// LDLᵀ of a symmetric positive definite matrix as NormalEquations has it: each control point (three rows) is tied to
/// the three before and behind it, and the last row to all. Nothing fills in, so time grows with the size alone.
class BandSolver {
 public:
  /// `matrix` must have 3 n + 1 rows; only its lower half is read, and of that only the band and the last row.
  explicit BandSolver(const RecycledMatrix& matrix);

  /// False where the matrix is not positive definite; then there is no solution.
  bool ok() const { return ok_; }
  RecycledColumn solve(const RecycledColumn& right) const;
  /// The inverse inside the band and in the last row and column, zero elsewhere (Takahashi's recurrence: an entry of
  /// the inverse where the factor has one depends on others of that kind alone).
  RecycledMatrix inverse_in_band() const;

 private:
  Eigen::Index first_in(Eigen::Index row) const;
  Eigen::Index end_in(Eigen::Index col) const;

  Recycled<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>
      lower_;  // only the band and the last row
  RecycledColumn diagonal_;
  bool ok_ = false;
};

}  // namespace tubetrack
