#include "scan_step.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {
namespace {

constexpr double kStepRadius_m = 0.01;

/// A bent line a little beside the surface's own, and points of the surface.
struct Bent {
  TubeModel model;
  std::vector<Observation> observations;
};

Bent bent_tube() {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.0001);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<Eigen::Vector3d> line_m;
  constexpr double kBend_m = 0.08;
  const auto place_m = [&](double angle_rad, double out_m) {
    return Eigen::Vector3d((kBend_m + out_m) * std::cos(angle_rad), (kBend_m + out_m) * std::sin(angle_rad), 0.0);
  };
  for (int i = 0; i <= 20; ++i) line_m.push_back(place_m(0.1 * i, 0.001));
  Bent bent;
  bent.model = {spline_along(line_m, kKnotSpacingRadii * kStepRadius_m), 0.9 * kStepRadius_m};
  for (int i = 0; i < 4000; ++i) {
    const double along_rad = 2.0 * unit(random), around_rad = 2.0 * std::numbers::pi * unit(random);
    const double distance_m = kStepRadius_m + noise(random);
    const Eigen::Vector3d outward =
        std::cos(around_rad) * place_m(along_rad, 0.0).normalized() + std::sin(around_rad) * Eigen::Vector3d::UnitZ();
    Observation observation{place_m(along_rad, 0.0) + distance_m * outward, -outward, 0.0001};
    observation.t = foot_parameter(bent.model.spline, observation.point_m, bent.model.spline.spans() * along_rad / 2.0);
    bent.observations.push_back(observation);
  }
  return bent;
}

TEST(ScanStep, InABandIsTheSameAsWithFullMatrices) {
  for (const bool known : {false, true}) {
    const Bent bent = bent_tube();
    FitOptions options;
    if (known) options.radius_m = kStepRadius_m;
    TubeModel band = bent.model, full = bent.model;
    const auto in_band = fit_scan_stretch(band, sort_by_stretch(bent.observations, band.spline), options);
    const auto in_full = fit_tube(full, bent.observations, options);
    ASSERT_TRUE(in_band && in_full);
    EXPECT_NEAR(band.radius_m, full.radius_m, 1e-12);
    EXPECT_NEAR(band.radius_m, kStepRadius_m, 1e-5);
    EXPECT_NEAR(in_band->radius_sigma_m, in_full->radius_sigma_m, 1e-9 * kStepRadius_m);
    const auto& q = band.spline.control_m;
    for (std::size_t k = 0; k < q.size(); ++k) {
      EXPECT_LT((q[k] - full.spline.control_m[k]).norm(), 1e-11);
      const auto at = static_cast<Eigen::Index>(3 * k);
      const Eigen::Matrix3d expected = in_full->covariance.block<3, 3>(at, at);
      EXPECT_LT((in_band->covariance.block(k, k) - expected).norm(), 1e-6 * expected.norm());
    }
  }
}

TEST(ScanStep, TooFewPointsAreNotFittedTo) {
  Bent bent = bent_tube();
  bent.observations.resize(19);
  EXPECT_FALSE(fit_scan_stretch(bent.model, sort_by_stretch(bent.observations, bent.model.spline), {}));
}

}  // namespace
}  // namespace tubetrack
