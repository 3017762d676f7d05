#include "tubetrack/tracker/predict.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "tracker/tube_scene.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

const Intrinsics kCamera{320, 240, 285.0, 285.0, 159.5, 119.5, {}};

Vector3d ray_of(const HeightMap& map, std::size_t cell) {
  return {map.rays[cell].x(), map.rays[cell].y(), 1.0};
}

struct Line {
  Vector3d point_m;
  Vector3d axis;

  Vector3d across(const Vector3d& point) const {
    const Vector3d off = point - point_m;
    return off - off.dot(axis) * axis;
  }
};

TEST(PredictPixels, OfAStraightTubeLieOnTheCylinder) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> gauss;
  const HeightMap map = make_height_map(kCamera);
  for (int i = 0; i < 20; ++i) {
    const Line line{{0.05 * gauss(random), 0.05 * gauss(random), 0.8},
                    Vector3d(gauss(random), gauss(random), 0.5 * gauss(random)).normalized()};
    const double radius = 0.02;
    const auto pixels = predict_pixels(map, NoiseModel{}, straight_model(line.point_m, line.axis, 0.15, radius));
    ASSERT_GT(pixels.size(), 200U);
    for (const PredictedPixel& pixel : pixels) {
      const Vector3d ray = ray_of(map, pixel.cell);
      const Vector3d normal = line.across(pixel.depth_m * ray);
      EXPECT_NEAR(normal.norm(), radius, 1e-6);
      EXPECT_NEAR(pixel.cos_incidence, -normal.dot(ray.normalized()) / radius, 1e-4);
      EXPECT_GE(pixel.cos_incidence, 0.0F);
      // The ray passes the axis nearest at axis_depth_m, |lateral| radii away.
      const Vector3d ray_across = ray - ray.dot(line.axis) * line.axis;
      EXPECT_NEAR(pixel.across, ray_across.norm(), 1e-6);
      const Vector3d nearest = line.across(pixel.axis_depth_m * ray);
      EXPECT_NEAR(nearest.dot(ray_across), 0.0, 1e-6);
      EXPECT_NEAR(std::abs(pixel.lateral), nearest.norm() / radius, 1e-4);
    }
  }
}

TEST(PredictPixels, LateralRunsFromOneSideToTheOther) {
  const HeightMap map = make_height_map(kCamera);
  const auto pixels = predict_pixels(map, NoiseModel{}, straight_model({0.0, 0.0, 0.8}, Vector3d::UnitX(), 0.1, 0.03));
  ASSERT_FALSE(pixels.empty());
  const bool top_positive = pixels[0].lateral > 0.0F;
  for (const PredictedPixel& pixel : pixels) {
    EXPECT_EQ(pixel.lateral > 0.0F, (pixel.cell / 320 < 120) == top_positive) << pixel.cell;
  }
}

TEST(PredictPixels, ComeOnceEachInCellOrder) {
  std::mt19937_64 random(5);
  const HeightMap map = make_height_map(kCamera);
  const auto axis = course_points(Course::s_bend, 0.02, 0.01, random_pose(random));
  std::vector<Vector3d> line;
  for (const AxisPoint& point : axis) line.push_back(point.position_m);
  const auto pixels = predict_pixels(map, NoiseModel{}, {spline_along(line, 0.025), 0.02});
  ASSERT_GT(pixels.size(), 300U);
  for (std::size_t i = 1; i < pixels.size(); ++i) EXPECT_LT(pixels[i - 1].cell, pixels[i].cell);
}

/// Walks along the ray until it is inside the tube around a finely sampled centreline; infinite where it never is.
double march(const std::vector<Vector3d>& centerline, double radius_m, const Vector3d& ray, double from_m,
             double to_m) {
  const auto distance = [&](double z) {
    double best = 1e9;
    for (const Vector3d& point : centerline) best = std::min(best, (z * ray - point).squaredNorm());
    return std::sqrt(best);
  };
  double z = from_m;
  while (z < to_m) {
    const double gap = distance(z) - radius_m;
    if (gap < 1e-5) return z;
    z += std::max(0.5 * gap / ray.norm(), 2e-6);
  }
  return std::numeric_limits<double>::infinity();
}

// The prediction cuts the tube into short straight pieces: a hundredth of a radius off, or so.
TEST(PredictPixels, OfABentTubeAreWhereARayWalkedInSmallStepsEnters) {
  std::mt19937_64 random(6);
  const double radius = 0.025;
  for (const Course course : {Course::straight, Course::torus, Course::s_bend}) {
    const auto axis = course_points(course, radius, 0.005, random_pose(random));
    std::vector<Vector3d> line;
    for (const AxisPoint& point : axis) line.push_back(point.position_m);
    const TubeModel model{spline_along(line, 1.25 * radius), radius};
    std::vector<Vector3d> fine;
    for (int i = 0; i <= 2000; ++i) fine.push_back(point_at(model.spline, model.spline.spans() * i / 2000.0));
    const HeightMap map = make_height_map(kCamera);
    std::map<std::uint32_t, PredictedPixel> predicted;
    for (const PredictedPixel& pixel : predict_pixels(map, NoiseModel{}, model)) predicted.emplace(pixel.cell, pixel);
    int both = 0;
    int missing = 0;
    for (std::uint32_t cell = 0; cell < map.rays.size(); cell += 7) {
      const auto found = predicted.find(cell);
      const double z = march(fine, radius, ray_of(map, cell), 0.3, 1.3);
      if (found == predicted.end() || std::isinf(z)) {
        // Only the silhouette and the rounded or cut ends may differ.
        const bool silhouette = found != predicted.end() && found->second.cos_incidence < 0.26F;
        const bool at_end =
            found != predicted.end() && (found->second.t < 0.2 || found->second.t > model.spline.spans() - 0.2);
        const double beyond = std::isinf(z) ? 0.0
                                            : std::min((z * ray_of(map, cell) - fine.front()).norm(),
                                                       (z * ray_of(map, cell) - fine.back()).norm());
        const bool on_end_cap = std::isfinite(z) && beyond < 1.02 * radius;
        missing += std::isfinite(z) && !on_end_cap ? 1 : 0;
        EXPECT_TRUE(found == predicted.end() || silhouette || at_end) << cell;
        continue;
      }
      const PredictedPixel& pixel = found->second;
      const bool inner = pixel.t > 0.5 && pixel.t < model.spline.spans() - 0.5;
      if (!inner || pixel.cos_incidence < 0.5F) continue;
      EXPECT_NEAR(pixel.depth_m, z, 0.02 * radius) << "t " << pixel.t << " cos " << pixel.cos_incidence;
      EXPECT_LT((point_at(model.spline, pixel.t) - z * ray_of(map, cell)).norm(), 1.03 * radius);
      ++both;
    }
    EXPECT_GT(both, 200);
    EXPECT_LE(missing, both / 50);  // at the silhouette
  }
}

TEST(PredictPixels, WhereTheLineIsTakenAsStraightAreNoFartherOffThanItIsBent) {
  std::mt19937_64 random(7);
  const double radius = 0.025;
  const double straight = 0.003;
  const HeightMap map = make_height_map(kCamera);
  for (const Course course : {Course::straight, Course::torus, Course::s_bend}) {
    std::vector<Vector3d> line;
    for (const AxisPoint& point : course_points(course, radius, 0.005, random_pose(random)))
      line.push_back(point.position_m);
    const TubeModel model{spline_along(line, 1.25 * radius), radius};
    PredictedPixels longer;
    predict_pixels(map, NoiseModel{}, model, 1, longer, straight);
    std::map<std::uint32_t, PredictedPixel> predicted;
    for (const PredictedPixel& pixel : predict_pixels(map, NoiseModel{}, model)) predicted.emplace(pixel.cell, pixel);
    std::size_t both = 0;
    for (const PredictedPixel& pixel : longer) {
      const auto found = predicted.find(pixel.cell);
      if (found == predicted.end()) continue;
      ++both;
      if (pixel.cos_incidence < 0.5F) continue;
      EXPECT_NEAR(pixel.depth_m, found->second.depth_m, 2.0 * straight * radius) << pixel.cell;
      EXPECT_NEAR(pixel.t, found->second.t, 0.02) << pixel.cell;
    }
    ASSERT_GT(both, 300U);
    EXPECT_GT(both, 0.99 * static_cast<double>(predicted.size()));
    EXPECT_GT(both, 0.99 * static_cast<double>(longer.size()));
  }
}

TEST(PredictPixels, WithAStrideAreEverySoManiethOfAll) {
  std::mt19937_64 random(7);
  const HeightMap map = make_height_map(kCamera);
  const auto axis = course_points(Course::torus, 0.02, 0.01, random_pose(random));
  std::vector<Vector3d> line;
  for (const AxisPoint& point : axis) line.push_back(point.position_m);
  const TubeModel model{spline_along(line, 0.025), 0.02};
  const auto all = predict_pixels(map, NoiseModel{}, model);
  PredictedPixels some;
  for (const int stride : {1, 2, 3}) {
    std::vector<PredictedPixel> wanted;
    std::copy_if(all.begin(), all.end(), std::back_inserter(wanted), [&](const PredictedPixel& pixel) {
      return static_cast<int>(pixel.cell % 320) % stride == 0 && static_cast<int>(pixel.cell / 320) % stride == 0;
    });
    predict_pixels(map, NoiseModel{}, model, stride, some);
    ASSERT_EQ(some.size(), wanted.size());
    for (std::size_t i = 0; i < some.size(); ++i) {
      EXPECT_EQ(some[i].cell, wanted[i].cell);
      EXPECT_EQ(some[i].depth_m, wanted[i].depth_m);
      EXPECT_EQ(some[i].sigma_m, wanted[i].sigma_m);
      EXPECT_EQ(some[i].lateral, wanted[i].lateral);
    }
  }
}

TEST(PredictPixels, ATubeThatComesUpToTheCameraIsLeftOutThere) {
  const HeightMap map = make_height_map(kCamera);
  const auto pixels = predict_pixels(map, NoiseModel{}, straight_model({0.0, 0.05, 0.3}, Vector3d::UnitZ(), 0.4, 0.02));
  for (const PredictedPixel& pixel : pixels) EXPECT_GT(pixel.depth_m, 0.0F);
}

TEST(SelectObservations, TakesReadingsWithinTheGateBelow75DegreesAndInsideTheSilhouetteWithoutTheJittersBias) {
  const Vector3d axis = Vector3d::UnitX();
  HeightMap map = cylinder_map(kCamera, {0.0, 0.0, 0.8}, axis, 0.1, 0.03);
  const TubeModel model = straight_model({0.0, 0.0, 0.8}, axis, 0.1, 0.03);
  const NoiseModel noise;
  const auto predicted = predict_pixels(map, NoiseModel{}, model);
  std::vector<PredictedPixel> wanted;
  for (const PredictedPixel& pixel : predicted) {
    if (map.depth_m[pixel.cell] <= 0.0F) continue;
    const double sigma = static_cast<double>(pixel.sigma_m);
    const double incidence = std::acos(static_cast<double>(pixel.cos_incidence));
    EXPECT_NEAR(sigma, depth_sigma_m(noise, pixel.depth_m, incidence, 285.0), 1e-6 * sigma);
    const std::size_t turn = pixel.cell % 3;  // as it is, just inside, just outside
    const double gate = 0.002 + 3.0 * sigma;
    map.depth_m[pixel.cell] = static_cast<float>(pixel.depth_m + pixel.jitter_bias_m +
                                                 (turn == 0   ? 0.0
                                                  : turn == 1 ? 0.99
                                                              : 1.01) *
                                                     gate);
    if (turn < 2 && pixel.margin_px >= 1.5F && incidence < 75.0 / 180.0 * std::numbers::pi) wanted.push_back(pixel);
  }
  const auto observations = select_observations(map, noise, predicted, 0.002, 3.0);
  ASSERT_EQ(observations.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const Vector3d ray = ray_of(map, wanted[i].cell);
    const double unbiased_m = 1.0 * map.depth_m[wanted[i].cell] - wanted[i].jitter_bias_m;
    EXPECT_LT((observations[i].point_m - unbiased_m * ray).norm(), 1e-12);
    EXPECT_NEAR(observations[i].direction.dot(ray), ray.norm(), 1e-12);
    EXPECT_NEAR(observations[i].sigma_m, static_cast<double>(wanted[i].sigma_m) * ray.norm(), 1e-12);
    EXPECT_EQ(observations[i].t, wanted[i].t);
  }
}

}  // namespace
}  // namespace tubetrack
