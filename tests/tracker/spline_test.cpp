#include "tubetrack/tracker/spline.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace tubetrack {
namespace {

using Eigen::Vector3d;

/// Control points 20 mm apart on a line that wanders sideways by a few millimetres: bends of 100 mm radius and more.
Spline random_spline(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss(0.0, 0.0025);
  Spline spline;
  Vector3d at(0.0, 0.0, 0.8);
  Vector3d step(0.02, 0.0, 0.0);
  for (int i = 0; i < 12; ++i) {
    spline.control_m.push_back(at);
    step = 0.02 * (step + Vector3d(0.0, gauss(random), gauss(random))).normalized();
    at += step;
  }
  return spline;
}

double any_parameter(const Spline& spline) {
  return *rc::gen::inRange(0, 100001) * 1e-5 * spline.spans();
}

RC_GTEST_PROP(Spline, BasisIsAPartitionOfUnity, (std::uint64_t seed)) {
  const Spline spline = random_spline(seed);
  const SplineBasis basis = basis_at(spline, any_parameter(spline));
  RC_ASSERT(basis.first + 4 <= spline.control_m.size());
  RC_ASSERT(std::abs(std::accumulate(basis.value.begin(), basis.value.end(), -1.0)) < 1e-14);
  RC_ASSERT(std::abs(std::accumulate(basis.derivative.begin(), basis.derivative.end(), 0.0)) < 1e-14);
  for (const double value : basis.value) RC_ASSERT(value >= 0.0);
}

RC_GTEST_PROP(Spline, DerivativeIsTheSlopeOfThePoint, (std::uint64_t seed)) {
  const Spline spline = random_spline(seed);
  constexpr double kStep = 1e-5;
  const double t = std::clamp(any_parameter(spline), kStep, spline.spans() - kStep);
  const Vector3d slope = (point_at(spline, t + kStep) - point_at(spline, t - kStep)) / (2.0 * kStep);
  RC_ASSERT((slope - derivative_at(spline, t)).norm() < 1e-8);
}

RC_GTEST_PROP(Spline, PolynomialsOfItsSpansAreTheCurve, (std::uint64_t seed)) {
  const Spline spline = random_spline(seed);
  const auto polynomials = polynomials_of(spline);
  RC_ASSERT(static_cast<double>(polynomials.size()) == spline.spans());
  const double t = any_parameter(spline);
  const std::size_t span = std::min(static_cast<std::size_t>(t), polynomials.size() - 1);
  const double s = t - static_cast<double>(span);
  const auto& [c0, c1, c2, c3] = polynomials[span];
  RC_ASSERT((c0 + s * (c1 + s * (c2 + s * c3)) - point_at(spline, t)).norm() < 1e-14);
}

TEST(Spline, RunsOnWithoutAJumpFromSpanToSpan) {
  const Spline spline = random_spline(5);
  for (double knot = 1.0; knot < spline.spans(); knot += 1.0) {
    EXPECT_LT((point_at(spline, knot - 1e-9) - point_at(spline, knot)).norm(), 1e-10);
    EXPECT_LT((derivative_at(spline, knot - 1e-9) - derivative_at(spline, knot)).norm(), 1e-9);
  }
}

TEST(Spline, BeyondItsEndsItStaysAtThem) {
  const Spline spline = random_spline(6);
  EXPECT_EQ(point_at(spline, -3.0), point_at(spline, 0.0));
  EXPECT_EQ(point_at(spline, spline.spans() + 3.0), point_at(spline, spline.spans()));
}

/// The closest point by looking everywhere, then closer and closer.
double foot_by_force(const Spline& spline, const Vector3d& point) {
  double low = 0.0;
  double high = spline.spans();
  double best = 0.0;
  for (int round = 0; round < 6; ++round) {
    const double step = (high - low) / 1000.0;
    double best_distance = 1e9;
    for (int i = 0; i <= 1000; ++i) {
      const double distance = (point_at(spline, low + i * step) - point).norm();
      if (distance < best_distance) {
        best_distance = distance;
        best = low + i * step;
      }
    }
    low = std::max(0.0, best - 2.0 * step);
    high = std::min(spline.spans(), best + 2.0 * step);
  }
  return best;
}

// Points on a tube of 15 mm radius: the foot's place converges by the ratio of the tube's radius to the bend's.
TEST(Spline, FootIsTheClosestPoint) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 200; ++i) {
    const Spline spline = random_spline(1000 + static_cast<std::uint64_t>(i));
    const double t = unit(random) * spline.spans();
    const Vector3d across =
        derivative_at(spline, t).cross(Vector3d(0.0, unit(random) - 0.5, unit(random) - 0.5)).normalized();
    const Vector3d point = point_at(spline, t) + 0.015 * across;
    const double expected = foot_by_force(spline, point);
    const double found = foot_parameter(spline, point, expected + 0.6 * (unit(random) - 0.5));
    EXPECT_NEAR(found, expected, 2e-3) << i;  // 40 µm along the tube
    EXPECT_NEAR((point_at(spline, found) - point).norm(), (point_at(spline, expected) - point).norm(), 1e-7) << i;
  }
}

TEST(Spline, FootOfAPointBeyondTheEndIsTheEnd) {
  const Spline spline = spline_along({Vector3d(0, 0, 1), Vector3d(0.1, 0, 1)}, 0.02);
  EXPECT_EQ(foot_parameter(spline, {0.15, 0.01, 1.0}, 4.0), spline.spans());
  EXPECT_EQ(foot_parameter(spline, {-0.05, 0.01, 1.0}, 1.0), 0.0);
}

TEST(Spline, AlongAPolylineItEndsWhereThatEnds) {
  const std::vector<Vector3d> line{{0.0, 0.0, 0.8}, {0.05, 0.01, 0.8}, {0.12, 0.01, 0.83}};
  const double length = (line[1] - line[0]).norm() + (line[2] - line[1]).norm();
  for (const double spacing : {0.01, 0.03, 1.0}) {
    const Spline spline = spline_along(line, spacing);
    EXPECT_EQ(spline.spans(), std::ceil(length / spacing));
    EXPECT_LT((point_at(spline, 0.0) - line.front()).norm(), 1e-5);
    EXPECT_LT((point_at(spline, spline.spans()) - line.back()).norm(), 1e-5);
    for (std::size_t k = 1; k < spline.control_m.size(); ++k) {
      EXPECT_LE((spline.control_m[k] - spline.control_m[k - 1]).norm(), spacing * (1.0 + 1e-12));
    }
  }
}

TEST(Spline, AlongAStraightLineItIsThatLineAtConstantSpeed) {
  const Vector3d from(0.1, -0.2, 0.7);
  const Vector3d to(0.3, 0.1, 0.9);
  const Spline spline = spline_along({from, from + 0.3 * (to - from), to}, 0.05);
  for (int i = 0; i <= 40; ++i) {
    const Vector3d point = point_at(spline, spline.spans() * i / 40.0);
    EXPECT_LT((point - (from + (to - from) * i / 40.0)).norm(), 1e-14);
  }
}

TEST(Spline, ExtendedItRunsStraightOnAndElsewhereStays) {
  const Spline before = random_spline(7);
  Spline after = before;
  extend(after, true, true);
  ASSERT_EQ(after.spans(), before.spans() + 2.0);
  for (double t = 0.0; t <= before.spans(); t += 0.1) {
    EXPECT_LT((point_at(after, t + 1.0) - point_at(before, t)).norm(), 1e-14);
  }
  // By the mean spacing, along the direction over two spans.
  const auto& q = before.control_m;
  double spacing = 0.0;
  for (std::size_t k = 1; k < q.size(); ++k) spacing += (q[k] - q[k - 1]).norm() / static_cast<double>(q.size() - 1);
  const Vector3d front = q[0] + spacing * (q[0] - q[2]).normalized();
  const Vector3d back = q.back() + spacing * (q.back() - q[q.size() - 3]).normalized();
  EXPECT_LT((after.control_m.front() - front).norm(), 1e-14);
  EXPECT_LT((after.control_m.back() - back).norm(), 1e-14);
}

}  // namespace
}  // namespace tubetrack
