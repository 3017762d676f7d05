#include "stretch_sums.hpp"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <Eigen/Geometry>
#include <cstring>
#include <random>

#include "tubetrack/tracker/predict.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

/// A tube that winds, and points on and about its surface with the place on the centreline a little off.
struct Scene {
  TubeModel model;
  std::vector<Observation> observations;
};

Scene random_scene(std::mt19937_64& random, int observations) {
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Scene scene;
  scene.model.radius_m = 0.01 + 0.02 * unit(random);
  Vector3d at(0.0, 0.0, 0.8);
  Vector3d step = Vector3d(gauss(random), gauss(random), 0.3 * gauss(random)).normalized();
  for (int i = 0; i < 14; ++i) {
    scene.model.spline.control_m.push_back(at);
    step = (step + 0.1 * Vector3d(gauss(random), gauss(random), gauss(random))).normalized();
    at += 1.25 * scene.model.radius_m * step;
  }
  const double spans = scene.model.spline.spans();
  for (int i = 0; i < observations; ++i) {
    const double t = spans * unit(random);
    const Vector3d along = derivative_at(scene.model.spline, t).normalized();
    Vector3d outward = along.cross(Vector3d(gauss(random), gauss(random), gauss(random))).normalized();
    if (outward.dot(point_at(scene.model.spline, t)) > 0.0) outward = -outward;  // as seen by the camera
    Observation observation;
    const Vector3d surface = point_at(scene.model.spline, t) + scene.model.radius_m * outward;
    observation.direction = surface.normalized();
    observation.sigma_m = 0.001 * (0.5 + unit(random));
    observation.point_m = surface + observation.sigma_m * gauss(random) * observation.direction;
    observation.t = t + 0.02 * gauss(random);
    scene.observations.push_back(observation);
  }
  return scene;
}

RecycledVector<StretchSums> sums_of(const Scene& scene) {
  return sum_stretches(scene.model, sort_by_stretch(scene.observations, scene.model.spline));
}

struct Totals {
  Eigen::Matrix<double, 15, 1> sums = Eigen::Matrix<double, 15, 1>::Zero();
  int used = 0;
};

Totals totals_of(const Eigen::Matrix3d& point_point, const Vector3d& point_radius, const Vector3d& point_residual,
                 double radius_radius, double radius_residual, double chi2, int used) {
  Totals totals;
  totals.sums << point_point(0, 0), point_point(0, 1), point_point(0, 2), point_point(1, 1), point_point(1, 2),
      point_point(2, 2), point_radius, point_residual, radius_radius, radius_residual, chi2;
  totals.used = used;
  return totals;
}

TEST(StretchSums, AreTheSumsOfTheTermsOneByOne) {
  std::mt19937_64 random(6);
  for (int round = 0; round < 50; ++round) {
    const Scene scene = random_scene(random, 1 + round * 17);
    Totals got, want, size;
    for (const StretchSums& s : sums_of(scene)) {
      const Totals one = totals_of(s.point_point, s.point_radius, s.point_residual, s.radius_radius, s.radius_residual,
                                   s.chi2, s.used);
      got.sums += one.sums;
      got.used += one.used;
    }
    for (const Observation& observation : scene.observations) {
      const ResidualTerm term = residual_of(scene.model, observation);
      if (!term.valid) continue;
      const double weight = 1.0 / (observation.sigma_m * observation.sigma_m);
      const Totals one =
          totals_of(weight * term.by_point * term.by_point.transpose(), weight * term.by_radius * term.by_point,
                    weight * term.residual_m * term.by_point, weight * term.by_radius * term.by_radius,
                    weight * term.by_radius * term.residual_m, weight * term.residual_m * term.residual_m, 1);
      want.sums += one.sums;
      size.sums += one.sums.cwiseAbs();
      want.used += 1;
    }
    EXPECT_NEAR(got.used, want.used, 1);
    // A foot over the border of its span is found on its own span's polynomial, which goes on a little differently.
    for (Eigen::Index i = 0; i < want.sums.size(); ++i) {
      EXPECT_NEAR(got.sums[i] / size.sums[i], want.sums[i] / size.sums[i], 2e-4) << round << ' ' << i;
    }
  }
}

TEST(StretchSums, AreTheSameBytesOnEveryTarget) {
  std::mt19937_64 random(7);
  const Scene scene = random_scene(random, 3000);
  const auto bytes = [&] {
    std::vector<double> all;
    for (const StretchSums& s : sums_of(scene)) {
      all.insert(all.end(), s.point_point.data(), s.point_point.data() + 9);
      all.insert(all.end(), s.point_radius.data(), s.point_radius.data() + 3);
      all.insert(all.end(), s.point_residual.data(), s.point_residual.data() + 3);
      all.insert(all.end(), {s.radius_radius, s.radius_residual, s.chi2, 1.0 * s.used});
    }
    return all;
  };
  const std::vector<double> best = bytes();
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    const std::vector<double> here = bytes();
    hwy::SetSupportedTargetsForTest(0);
    ASSERT_EQ(here.size(), best.size());
    EXPECT_EQ(std::memcmp(here.data(), best.data(), best.size() * sizeof(double)), 0) << target;
  }
}

TEST(StretchSums, NothingObservedIsNothing) {
  std::mt19937_64 random(8);
  const Scene scene = random_scene(random, 0);
  for (const StretchSums& s : sums_of({scene.model, {}})) EXPECT_EQ(s.used, 0);
}

}  // namespace
}  // namespace tubetrack
