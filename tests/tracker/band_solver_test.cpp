#include "band_solver.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

namespace tubetrack {
namespace {

/// Positive definite, of the shape that the normal equations have: chance terms over four control points and the
/// radius.
Eigen::MatrixXd random_band(int control_points, std::mt19937_64& random) {
  std::normal_distribution<double> gauss;
  const Eigen::Index size = 3 * control_points + 1;
  Eigen::MatrixXd matrix = 0.1 * Eigen::MatrixXd::Identity(size, size);
  for (Eigen::Index first = 0; first + 12 < size; first += 3) {
    for (int i = 0; i < 5; ++i) {
      Eigen::VectorXd term = Eigen::VectorXd::Zero(size);
      for (Eigen::Index k = 0; k < 12; ++k) term[first + k] = gauss(random);
      term[size - 1] = gauss(random);
      matrix += term * term.transpose();
    }
  }
  return matrix;
}

TEST(BandSolver, SolvesAndInvertsInsideTheBandAsADenseInverseDoes) {
  std::mt19937_64 random(3);
  for (const int control_points : {4, 5, 9, 40}) {
    const Eigen::MatrixXd matrix = random_band(control_points, random);
    const BandSolver solver(matrix);
    ASSERT_TRUE(solver.ok());
    const Eigen::MatrixXd dense = matrix.inverse();
    const Eigen::VectorXd right = Eigen::VectorXd::Random(matrix.rows());
    EXPECT_LT((solver.solve(right) - dense * right).norm(), 1e-9 * (dense * right).norm());
    const Eigen::MatrixXd band = solver.inverse_in_band();
    const double scale = dense.cwiseAbs().maxCoeff();
    const Eigen::Index last = matrix.rows() - 1;
    for (Eigen::Index row = 0; row <= last; ++row) {
      for (Eigen::Index col = 0; col <= row; ++col) {
        const bool inside = row == last || row / 3 - col / 3 <= 3;
        EXPECT_NEAR(band(row, col), inside ? dense(row, col) : 0.0, 1e-10 * scale) << row << ' ' << col;
        EXPECT_EQ(band(row, col), band(col, row));
      }
    }
  }
}

TEST(BandSolver, WhatObservesOnlyAPartOfTheBandIsInvertedAllTheSame) {
  std::mt19937_64 random(4);
  Eigen::MatrixXd matrix = random_band(8, random);
  // As where nothing is observed: priors tie control points along each coordinate by itself.
  for (Eigen::Index row = 12; row < matrix.rows() - 1; ++row) {
    for (Eigen::Index col = 0; col < row; ++col) {
      if (row % 3 != col % 3) matrix(row, col) = matrix(col, row) = 0.0;
    }
  }
  matrix.diagonal().array() += 100.0;
  const BandSolver solver(matrix);
  ASSERT_TRUE(solver.ok());
  const Eigen::MatrixXd dense = matrix.inverse();
  const Eigen::MatrixXd band = solver.inverse_in_band();
  for (Eigen::Index row = 0; row + 1 < matrix.rows(); ++row) {
    for (Eigen::Index col = 0; col <= row; ++col) {
      if (row / 3 - col / 3 > 3) continue;
      EXPECT_NEAR(band(row, col), dense(row, col), 1e-13) << row << ' ' << col;
    }
  }
}

TEST(BandSolver, AMatrixThatIsNotPositiveDefiniteIsNotSolved) {
  std::mt19937_64 random(5);
  Eigen::MatrixXd matrix = random_band(6, random);
  matrix(4, 4) = -1.0;
  EXPECT_FALSE(BandSolver(matrix).ok());
}

}  // namespace
}  // namespace tubetrack
