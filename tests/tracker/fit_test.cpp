#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "tracker/tube_scene.hpp"
#include "tubetrack/sensors/noise_model.hpp"
#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

/// A gently bent tube 0.8 m away.
TubeModel random_tube(std::mt19937_64& random) {
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> radius(0.008, 0.03);
  TubeModel model;
  model.radius_m = radius(random);
  const double spacing = 1.25 * model.radius_m;
  Vector3d at(0.05 * gauss(random), 0.05 * gauss(random), 0.8);
  Vector3d step = Vector3d(gauss(random), gauss(random), 0.3 * gauss(random)).normalized();
  for (int i = 0; i < 8; ++i) {
    model.spline.control_m.push_back(at);
    step = (step + 0.1 * Vector3d(gauss(random), gauss(random), gauss(random))).normalized();
    at += spacing * step;
  }
  return model;
}

/// A measured point near the side of the tube that its ray meets; empty where the ray only grazes it.
std::optional<Observation> random_observation(const TubeModel& model, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> gauss;
  Observation observation;
  observation.t = 1.0 + unit(random) * (model.spline.spans() - 2.0);
  const Vector3d center = point_at(model.spline, observation.t);
  const Vector3d along = derivative_at(model.spline, observation.t).normalized();
  const Vector3d outward = along.cross(Vector3d(gauss(random), gauss(random), gauss(random))).normalized();
  const Vector3d surface = center + model.radius_m * outward;
  observation.direction = surface.normalized();
  if (outward.dot(observation.direction) > -0.35) return std::nullopt;
  observation.point_m = surface + 0.05 * model.radius_m * gauss(random) * observation.direction;
  return observation;
}

TEST(ResidualTerm, DerivativesAreTheSlopesOfTheResidual) {
  std::mt19937_64 random(1);
  int checked = 0;
  for (int i = 0; i < 2000; ++i) {
    TubeModel model = random_tube(random);
    const auto observation = random_observation(model, random);
    if (!observation) continue;
    const ResidualTerm term = residual_of(model, *observation);
    ASSERT_TRUE(term.valid);
    const auto slope = [&](double& value) {
      const double step = 1e-5;
      const double before = value;
      value = before + step;
      const double high = residual_of(model, *observation).residual_m;
      value = before - step;
      const double low = residual_of(model, *observation).residual_m;
      value = before;
      return (high - low) / (2.0 * step);
    };
    const double tolerance = 5e-3 * std::abs(term.by_radius);
    // The residual is measured − predicted: what Gauss-Newton needs are the slopes of the predicted.
    EXPECT_NEAR(term.by_radius, -slope(model.radius_m), tolerance);
    for (std::size_t k = 0; k < 4; ++k) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const double expected = term.basis.value[k] * term.by_point[axis];
        EXPECT_NEAR(expected, -slope(model.spline.control_m[term.basis.first + k][axis]), tolerance);
      }
    }
    ++checked;
  }
  EXPECT_GT(checked, 500);
}

TEST(ResidualTerm, IsTheDistanceAlongTheRayFromThePredictedSurface) {
  const Vector3d axis = Vector3d(1.0, 0.4, 0.2).normalized();
  const TubeModel model = straight_model({0.0, 0.02, 0.8}, axis, 0.2, 0.015);
  const HeightMap map = cylinder_map(kVga, {0.0, 0.02, 0.8}, axis, 0.15, 0.015);
  for (const PredictedPixel& pixel : predict_pixels(map, NoiseModel{}, model)) {
    if (map.depth_m[pixel.cell] <= 0.0F || pixel.cos_incidence < 0.3F) continue;
    const Vector3d ray = Vector3d(map.rays[pixel.cell].x(), map.rays[pixel.cell].y(), 1.0);
    for (const double off_m : {-0.004, 0.0, 0.004}) {
      const Observation observation{pixel.depth_m * ray + off_m * ray.normalized(), ray.normalized(), 0.001, pixel.t};
      const ResidualTerm term = residual_of(model, observation);
      ASSERT_TRUE(term.valid);
      EXPECT_NEAR(term.residual_m, off_m, 1e-6);
    }
  }
}

TEST(ResidualTerm, ARayThatGrazesOrMissesIsNotValid) {
  const TubeModel model = straight_model({0.0, 0.0, 0.8}, Vector3d::UnitX(), 0.1, 0.02);
  const double spans = model.spline.spans();
  const Vector3d grazing(0.0, 0.0199 / 0.8, 1.0);
  EXPECT_FALSE(residual_of(model, {0.8 * grazing, grazing.normalized(), 0.001, 0.5 * spans}).valid);
  const Vector3d missing(0.0, 0.05, 1.0);
  EXPECT_FALSE(residual_of(model, {0.8 * missing, missing.normalized(), 0.001, 0.5 * spans}).valid);
}

// Whether a reading counts must not depend on its residual: dropping the deep ones at the silhouettes alone would make
// every tube too thick.
TEST(ResidualTerm, AReadingAnywhereOnARayThatMeetsTheTubeCounts) {
  const TubeModel model = straight_model({0.0, 0.0, 0.8}, Vector3d::UnitX(), 0.1, 0.02);
  for (const double lateral : {0.0, 0.5, 0.9, 0.96}) {
    const Vector3d ray = Vector3d(0.0, lateral * 0.02 / std::sqrt(0.64 - 0.02 * 0.02 * lateral * lateral), 1.0);
    const double a = ray.squaredNorm();
    const double z = (0.8 - std::sqrt(0.64 - a * (0.64 - 0.02 * 0.02))) / a;
    for (const double off_m : {-0.04, -0.01, 0.01, 0.04}) {
      const Observation reading{z * ray + off_m * ray.normalized(), ray.normalized(), 0.001,
                                0.5 * model.spline.spans()};
      const ResidualTerm term = residual_of(model, reading);
      ASSERT_TRUE(term.valid) << lateral << ' ' << off_m;
      EXPECT_NEAR(term.residual_m, off_m, 1e-6);
    }
  }
}

/// A straight tube across the view, and what the camera sees of it.
struct Straight {
  Vector3d point_m{0.01, -0.02, 0.8};
  Vector3d axis = Vector3d(1.0, 0.3, 0.15).normalized();
  double radius_m = 0.015;
  double half_m = 0.1;

  double distance_m(const Vector3d& point) const { return (point - point_m).cross(axis).norm(); }
};

/// Observations of all pixels with incidence below 75°, with Gaussian noise of the model's σ along the ray.
std::vector<Observation> observe(const Straight& tube, std::mt19937_64* random) {
  const HeightMap map = cylinder_map(kVga, tube.point_m, tube.axis, tube.half_m, tube.radius_m);
  const TubeModel model = straight_model(tube.point_m, tube.axis, tube.half_m, tube.radius_m);
  const NoiseModel noise;
  std::normal_distribution<double> gauss;
  std::vector<Observation> observations;
  for (const PredictedPixel& pixel : predict_pixels(map, NoiseModel{}, model)) {
    if (pixel.cos_incidence < 0.2588F || map.depth_m[pixel.cell] <= 0.0F) continue;
    const Vector3d ray(map.rays[pixel.cell].x(), map.rays[pixel.cell].y(), 1.0);
    const double sigma = static_cast<double>(pixel.sigma_m);
    const double z = pixel.depth_m + (random ? sigma * gauss(*random) : 0.0);
    observations.push_back({z * ray, ray.normalized(), sigma * ray.norm(), pixel.t});
  }
  return observations;
}

TEST(Fit, ExactPointsGiveTheAxisAndTheRadiusToAMicrometre) {
  std::mt19937_64 random(2);
  const Straight tube;
  auto observations = observe(tube, nullptr);
  for (const double suppleness : {1.0, 0.01}) {
    TubeModel model =
        straight_model(tube.point_m + Vector3d(0.0, 0.003, -0.004), (tube.axis + Vector3d(0, 0.02, -0.02)).normalized(),
                       tube.half_m, 1.2 * tube.radius_m);
    FitOptions options;
    options.suppleness = suppleness;
    options.gauss_newton_steps = 4;
    std::optional<FitQuality> quality;
    for (int round = 0; round < 4; ++round) {
      for (Observation& observation : observations) {
        observation.t = foot_parameter(model.spline, observation.point_m, observation.t);
      }
      quality = fit_tube(model, observations, options);
      ASSERT_TRUE(quality);
    }
    EXPECT_NEAR(model.radius_m, tube.radius_m, 1e-6);
    EXPECT_LT(quality->chi2_per_observation, 1e-6);
    for (double t = 0.5; t < model.spline.spans() - 0.5; t += 0.25) {
      EXPECT_LT(tube.distance_m(point_at(model.spline, t)), 1e-6) << t;
    }
  }
}

TEST(Fit, AnEndThatNothingObservesComesOutOfItsKinkAndGoesOnAsTheTubeDoes) {
  const Straight tube;
  auto observations = observe(tube, nullptr);
  TubeModel model = straight_model(tube.point_m, tube.axis, tube.half_m, tube.radius_m);
  std::erase_if(observations, [&](const Observation& o) { return o.t < 2.0 || o.t > model.spline.spans() - 2.0; });
  auto& control = model.spline.control_m;
  const double spacing = (control[1] - control[0]).norm();
  control.back() += tube.radius_m * tube.axis.cross(Vector3d::UnitZ()).normalized();
  control.front() -= tube.radius_m * Vector3d::UnitZ();
  FitOptions options;
  options.radius_m = tube.radius_m;
  options.gauss_newton_steps = 30;  // as over so many frames
  ASSERT_TRUE(fit_tube(model, observations, options));
  for (const Vector3d& point : control) EXPECT_LT(tube.distance_m(point), 1e-5);
  for (std::size_t k = 0; k + 1 < control.size(); ++k) {
    EXPECT_NEAR((control[k + 1] - control[k]).norm(), spacing, 0.025 * spacing) << k;
  }
}

TEST(Fit, AKnownRadiusIsHeld) {
  const Straight tube;
  TubeModel model = straight_model(tube.point_m, tube.axis, tube.half_m, 0.01);
  FitOptions options;
  options.radius_m = 0.0151;
  const auto quality = fit_tube(model, observe(tube, nullptr), options);
  ASSERT_TRUE(quality);
  EXPECT_EQ(model.radius_m, 0.0151);
  EXPECT_EQ(quality->radius_sigma_m, 0.0);
}

TEST(Fit, TooLittleObservedGivesNothing) {
  const Straight tube;
  auto observations = observe(tube, nullptr);
  observations.resize(19);
  TubeModel model = straight_model(tube.point_m, tube.axis, tube.half_m, tube.radius_m);
  EXPECT_FALSE(fit_tube(model, observations, {}));
}

TEST(Fit, ARadiusOutOfItsRangeGivesNothing) {
  const Straight tube;
  TubeModel model = straight_model(tube.point_m, tube.axis, tube.half_m, tube.radius_m);
  FitOptions options;
  options.radius_max_m = 0.012;
  EXPECT_FALSE(fit_tube(model, observe(tube, nullptr), options));
}

struct Statistics {
  double sum = 0.0, squares = 0.0;
  int n = 0;

  void add(double value) {
    sum += value;
    squares += value * value;
    ++n;
  }
  double mean() const { return sum / n; }
  double deviation() const { return std::sqrt(squares / n - mean() * mean()); }
};

/// 300 single noisy views of a half-visible tube: how far off the fit's middle and radius are, and how far it says.
struct Trials {
  Statistics depth_mm;  ///< of the axis, along the view
  Statistics radius_mm;
  Statistics chi2;
  Statistics depth_sigma_mm;
  Statistics radius_sigma_mm;
};

Trials try_fits(const Straight& tube, bool radius_known) {
  Trials trials;
  std::mt19937_64 random(11);
  const Vector3d view = (tube.point_m - tube.point_m.dot(tube.axis) * tube.axis).normalized();
  for (int i = 0; i < 300; ++i) {
    const auto observations = observe(tube, &random);
    TubeModel model = straight_model(tube.point_m + 0.002 * view, tube.axis, tube.half_m, 0.9 * tube.radius_m);
    FitOptions options;
    options.suppleness = 0.01;  // straight
    options.gauss_newton_steps = 6;
    if (radius_known) options.radius_m = tube.radius_m;
    const auto quality = fit_tube(model, observations, options);
    if (!quality) {
      ADD_FAILURE() << "no fit";
      continue;
    }
    const double middle = 0.5 * model.spline.spans();
    trials.depth_mm.add(1e3 * (point_at(model.spline, middle) - tube.point_m).dot(view));
    trials.radius_mm.add(1e3 * (model.radius_m - tube.radius_m));
    trials.chi2.add(quality->chi2_per_observation);
    trials.radius_sigma_mm.add(1e3 * quality->radius_sigma_m);
    const SplineBasis basis = basis_at(model.spline, middle);
    double variance = 0.0;
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b < 4; ++b) {
        const auto row = static_cast<Eigen::Index>(3 * (basis.first + a));
        const auto col = static_cast<Eigen::Index>(3 * (basis.first + b));
        variance += basis.value[a] * basis.value[b] * view.dot(quality->covariance.block<3, 3>(row, col) * view);
      }
    }
    trials.depth_sigma_mm.add(1e3 * std::sqrt(variance));
  }
  return trials;
}

void print(const char* what, const Trials& t) {
  std::printf("%s: depth %+.3f ± %.3f mm (says %.3f), radius %+.3f ± %.3f mm (says %.3f), χ² %.3f\n", what,
              t.depth_mm.mean(), t.depth_mm.deviation(), t.depth_sigma_mm.mean(), t.radius_mm.mean(),
              t.radius_mm.deviation(), t.radius_sigma_mm.mean(), t.chi2.mean());
}

// 40 mm of a tube of 15 mm radius, 0.8 m away: DESIGN §2 measured 0.02 ± 0.07 mm.
TEST(Fit, OverNoisyHalfViewsOfAKnownRadiusIsUnbiased) {
  Straight tube;
  tube.half_m = 0.02;
  const Trials trials = try_fits(tube, true);
  print("radius known", trials);
  EXPECT_NEAR(trials.depth_mm.mean(), 0.0, 0.015);
  EXPECT_LT(trials.depth_mm.deviation(), 0.10);
  EXPECT_NEAR(trials.chi2.mean(), 1.0, 0.03);
  EXPECT_NEAR(trials.depth_mm.deviation() / trials.depth_sigma_mm.mean(), 1.0, 0.15);
}

// … and 0.07 ± 0.45 mm with the radius free.
TEST(Fit, OverNoisyHalfViewsOfAFreeRadiusIsUnbiased) {
  Straight tube;
  tube.half_m = 0.02;
  const Trials trials = try_fits(tube, false);
  print("radius free", trials);
  EXPECT_NEAR(trials.depth_mm.mean(), 0.0, 0.05);
  EXPECT_LT(trials.depth_mm.deviation(), 0.35);
  EXPECT_NEAR(trials.radius_mm.mean(), 0.0, 0.05);
  EXPECT_LT(trials.radius_mm.deviation(), 0.30);
  EXPECT_NEAR(trials.radius_mm.deviation() / trials.radius_sigma_mm.mean(), 1.0, 0.15);
  EXPECT_NEAR(trials.depth_mm.deviation() / trials.depth_sigma_mm.mean(), 1.0, 0.15);
}

}  // namespace
}  // namespace tubetrack
