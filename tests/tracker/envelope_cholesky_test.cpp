#include "envelope_cholesky.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

namespace tubetrack {
namespace {

/// Symmetric, positive definite, a band of twelve and a full last row, as the normal equations of a spline.
Eigen::MatrixXd banded(Eigen::Index size, std::mt19937_64& random) {
  std::normal_distribution<double> gauss;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index first = 0; first + 12 < size; first += 3) {
    for (int i = 0; i < 20; ++i) {
      Eigen::VectorXd row = Eigen::VectorXd::Zero(size);
      for (Eigen::Index k = 0; k < 12; ++k) row[first + k] = gauss(random);
      row[size - 1] = gauss(random);
      matrix += row * row.transpose();
    }
  }
  matrix.diagonal().array() += 0.1;
  return matrix;
}

TEST(EnvelopeCholesky, SolvesAndInvertsAsTheDenseOne) {
  std::mt19937_64 random(1);
  for (const Eigen::Index size : {1, 2, 13, 40, 106, 151}) {
    const Eigen::MatrixXd matrix = banded(size, random);
    const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(size, -1.0, 2.0);
    const Eigen::LDLT<Eigen::MatrixXd> dense(matrix);
    const auto factor = factor_envelope(matrix);
    ASSERT_TRUE(factor) << size;
    const Eigen::VectorXd want = dense.solve(right);
    EXPECT_LT((solve(*factor, right) - want).norm(), 1e-10 * want.norm()) << size;
    const Eigen::MatrixXd inverse = dense.solve(Eigen::MatrixXd::Identity(size, size));
    EXPECT_LT((inverse_of(*factor) - inverse).norm(), 1e-10 * inverse.norm()) << size;
  }
}

TEST(EnvelopeCholesky, TakesAFullMatrix) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> gauss;
  Eigen::MatrixXd root = Eigen::MatrixXd::NullaryExpr(30, 30, [&] { return gauss(random); });
  const Eigen::MatrixXd matrix = root * root.transpose() + Eigen::MatrixXd::Identity(30, 30);
  const auto factor = factor_envelope(matrix);
  ASSERT_TRUE(factor);
  EXPECT_LT((inverse_of(*factor) * matrix - Eigen::MatrixXd::Identity(30, 30)).norm(), 1e-10);
}

TEST(EnvelopeCholesky, RefusesWhatIsNotPositiveDefiniteOrNotFinite) {
  std::mt19937_64 random(3);
  Eigen::MatrixXd matrix = banded(40, random);
  matrix(20, 20) = -1.0;
  EXPECT_FALSE(factor_envelope(matrix));
  matrix(20, 20) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(factor_envelope(matrix));
}

}  // namespace
}  // namespace tubetrack
