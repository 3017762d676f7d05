#include "varying_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "stretch_sums.hpp"

namespace tubetrack {
namespace {

/// A bent tube seen from the origin, whose radius swells along it.
TubeModel swelling_tube() {
  std::vector<Eigen::Vector3d> line;
  for (int i = 0; i <= 20; ++i) line.emplace_back(-0.2 + 0.02 * i, 0.02 * std::sin(0.2 * i), 0.8);
  TubeModel model{spline_along(line, 0.025), 0.02};
  cover(model.profile, model.spline);
  for (std::size_t k = 0; k < model.profile.offset_m.size(); ++k)
    model.profile.offset_m[k] = 0.003 * std::sin(1.3 * static_cast<double>(k));
  return model;
}

/// Readings of its surface, as far off as `noise_m`, seen along their rays.
std::vector<Observation> readings_of(const TubeModel& model, double noise_m) {
  std::mt19937 random(1);
  std::normal_distribution<double> gauss;
  std::vector<Observation> readings;
  for (double t = 1.05; t < model.spline.spans() - 1.0; t += 0.02) {
    for (double angle = -1.0; angle <= 1.0; angle += 0.1) {
      const Eigen::Vector3d along = derivative_at(model.spline, t).normalized();
      const Eigen::Vector3d at = point_at(model.spline, t);
      const Eigen::Vector3d toward = (along.dot(at) * along - at).normalized();
      const Eigen::Vector3d out = std::cos(angle) * toward + std::sin(angle) * along.cross(toward);
      const Eigen::Vector3d point = at + radius_at(model, t) * out;
      const Eigen::Vector3d ray = point.normalized();
      readings.push_back({point + noise_m * gauss(random) * ray, ray, 0.001, t});
    }
  }
  return readings;
}

double chi2(const TubeModel& model, const SortedObservations& readings) {
  double sum = 0.0;
  for (const StretchSums& stretch : sum_stretches(model, readings)) sum += stretch.chi2;
  return sum;
}

TEST(RadiusProfile, StaysInItsPlaceWhereTheLineGrowsOrShrinksAtItsFront) {
  TubeModel model = swelling_tube();
  const double before_m = radius_at(model, 2.3);
  extend(model.spline, true, true);
  EXPECT_DOUBLE_EQ(radius_at(model, 3.3), before_m);
  cover(model.profile, model.spline);
  EXPECT_DOUBLE_EQ(radius_at(model, 3.3), before_m);
}

TEST(RadiusProfile, ItsRightSideIsTheDerivativeOfChi2) {
  const TubeModel model = swelling_tube();
  TubeModel off = model;
  for (double& offset_m : off.profile.offset_m) offset_m += 0.0004;
  const auto readings = sort_by_stretch(readings_of(model, 0.0005), model.spline);
  const ProfileEquations eq = profile_equations(off, sum_stretches(off, readings));
  constexpr double kStep_m = 3e-5;  // sums are floats
  for (std::size_t k = 0; k < off.profile.offset_m.size(); ++k) {
    TubeModel more = off, less = off;
    more.profile.offset_m[k] += kStep_m;
    less.profile.offset_m[k] -= kStep_m;
    const double numeric = (chi2(more, readings) - chi2(less, readings)) / (2.0 * kStep_m);
    EXPECT_NEAR(-2.0 * eq.right[static_cast<Eigen::Index>(k)], numeric, 1e-4 * std::abs(numeric) + 10.0) << k;
  }
}

TEST(RadiusProfile, WithoutNoiseAFitFindsLineAndRadiiFromOneRadius) {
  const TubeModel truth = swelling_tube();
  TubeModel model = truth;
  model.profile = {};
  for (Eigen::Vector3d& control : model.spline.control_m) control.z() += 0.002;
  FitOptions options;
  options.varying_radius = true;
  options.gauss_newton_steps = 6;
  const auto quality = fit_tube(model, readings_of(truth, 0.0), options);
  ASSERT_TRUE(quality);
  EXPECT_LT(quality->chi2_per_observation, 0.01);
  for (double t = 3.0; t < truth.spline.spans() - 3.0; t += 0.5) {
    EXPECT_NEAR(radius_at(model, t), radius_at(truth, t), 0.0002) << t;
    EXPECT_NEAR(point_at(model.spline, t).z(), point_at(truth.spline, t).z(), 0.0002) << t;
  }
}

// Not to the half quite: what is known of lines and profiles beforehand does not count twice.
TEST(RadiusProfile, WhatTwoFitsSayOfItAddsUpToAboutHalfTheVariance) {
  const TubeModel truth = swelling_tube();
  const auto readings = readings_of(truth, 0.001);
  TubeModel model = truth;
  FitOptions options;
  options.varying_radius = true;
  const auto first = fit_tube(model, readings, options);
  ASSERT_TRUE(first);
  options.profile_prior = &first->profile;
  options.prior = &first->observed;
  options.prior_has_places = true;
  const auto second = fit_tube(model, readings, options);
  ASSERT_TRUE(second);
  EXPECT_NEAR(second->radius_sigma_m / first->radius_sigma_m, std::sqrt(0.5), 0.02);
  const Eigen::Index middle = 3 * static_cast<Eigen::Index>(truth.spline.control_m.size() / 2) + 2;
  EXPECT_NEAR(second->covariance(middle, middle) / first->covariance(middle, middle), 0.5, 0.12);
}

}  // namespace
}  // namespace tubetrack
