#include "tubetrack/heightmap/plane_map.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace tubetrack {
namespace {

const Intrinsics kSmallCamera{160, 120, 140.0, 140.0, 79.5, 59.5, {}};

/// A table in this plane, and a block of that height on it where |x|, |y| in the camera's frame are below 5 cm.
HeightMap table(const SupportPlane& plane, double block_m) {
  HeightMap map = make_height_map(kSmallCamera);
  for (std::size_t cell = 0; cell < map.rays.size(); ++cell) {
    const Eigen::Vector3d ray(map.rays[cell].x(), map.rays[cell].y(), 1.0);
    double depth_m = plane.distance_m / plane.normal.dot(ray);
    const double on_block_m = (plane.distance_m - block_m) / plane.normal.dot(ray);
    if ((on_block_m * ray).head<2>().cwiseAbs().maxCoeff() < 0.05) depth_m = on_block_m;
    map.depth_m[cell] = static_cast<float>(depth_m);
  }
  return map;
}

SupportPlane tilted() {
  return {Eigen::Vector3d(0.1, 0.4, 1.0).normalized(), 0.7};
}

/// At a place of the plane that the camera sees along its axis, and how far across.
double height_near(const PlaneMap& map, double x_m, double y_m) {
  const int col = static_cast<int>(std::floor(x_m / map.cell_m)) - map.first_col;
  const int row = static_cast<int>(std::floor(y_m / map.cell_m)) - map.first_row;
  return map.height_m.at(static_cast<std::size_t>(row) * static_cast<std::size_t>(map.width) +
                         static_cast<std::size_t>(col));
}

TEST(LargestPlane, IsTheTableUnderABlock) {
  const auto plane = largest_plane(table(tilted(), 0.08));
  ASSERT_TRUE(plane);
  EXPECT_GT(plane->normal.dot(tilted().normal), std::cos(0.002));
  EXPECT_NEAR(plane->distance_m, tilted().distance_m, 0.001);
}

TEST(LargestPlane, IsNoneWhereNothingReturns) {
  EXPECT_FALSE(largest_plane(make_height_map(kSmallCamera)));
}

TEST(PlaneMap, HoldsHeightsOverThePlane) {
  const HeightMap seen = table(tilted(), 0.08);
  PlaneMap map = make_plane_map(tilted(), Eigen::Isometry3d::Identity(), seen, 0.01);
  fuse(map, seen, {}, Eigen::Isometry3d::Identity());
  EXPECT_NEAR(height_near(map, 0.0, -0.01), 0.08, 0.0005);
  EXPECT_NEAR(height_near(map, 0.15, 0.1), 0.0, 0.0005);
}

TEST(PlaneMap, IsTheSameFromACameraThatMoved) {
  const HeightMap seen = table({Eigen::Vector3d::UnitZ(), 0.7}, 0.0);
  PlaneMap map = make_plane_map({Eigen::Vector3d::UnitZ(), 0.7}, Eigen::Isometry3d::Identity(), seen, 0.01);
  fuse(map, seen, {}, Eigen::Isometry3d::Identity());
  const int width = map.width;
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  moved.translation() = Eigen::Vector3d(1.0, 0.0, 0.0);
  fuse(map, seen, {}, moved);
  EXPECT_GT(map.width, width) << "grows where the camera goes";
  EXPECT_NEAR(height_near(map, 0.0, 0.0), 0.0, 1e-6);
  EXPECT_NEAR(height_near(map, 1.0, 0.0), 0.0, 1e-6);
}

TEST(PlaneMap, AHeightSeenOnceGivesWayToWhatIsSeenOften) {
  const SupportPlane plane = tilted();
  const HeightMap flat = table(plane, 0.0), with_block = table(plane, 0.08);
  PlaneMap map = make_plane_map(plane, Eigen::Isometry3d::Identity(), flat, 0.01);
  fuse(map, with_block, {}, Eigen::Isometry3d::Identity());
  EXPECT_NEAR(height_near(map, 0.0, -0.01), 0.08, 0.0005);
  for (int i = 0; i < 3; ++i) fuse(map, flat, {}, Eigen::Isometry3d::Identity());
  EXPECT_NEAR(height_near(map, 0.0, -0.01), 0.0, 0.0005);
  fuse(map, with_block, {}, Eigen::Isometry3d::Identity());
  EXPECT_NEAR(height_near(map, 0.0, -0.01), 0.0, 0.0005) << "three frames against one";
}

TEST(PlaneMap, LeavesOutWhatLiesUnderThePlane) {
  const HeightMap seen = table({Eigen::Vector3d::UnitZ(), 0.7}, -0.1);
  PlaneMap map = make_plane_map({Eigen::Vector3d::UnitZ(), 0.7}, Eigen::Isometry3d::Identity(), seen, 0.01);
  fuse(map, seen, {}, Eigen::Isometry3d::Identity());
  EXPECT_TRUE(std::isnan(height_near(map, 0.0, 0.0)));
}

/// Half a tube (a ridge of radius 20 mm along x) on the plane z = 0 of the world, whose z points down, seen by a camera
/// that looks down at it at 45°.
struct Ridge {
  static constexpr double kRadius_m = 0.02;

  static Eigen::Isometry3d world_from_camera() {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(0.25 * std::numbers::pi, Eigen::Vector3d::UnitX()).toRotationMatrix();
    pose.translation() = -0.85 * pose.linear().col(2);
    return pose;
  }
  static HeightMap seen(double sigma_m, std::mt19937& random) {
    const Intrinsics camera{320, 240, 570.0, 570.0, 159.5, 119.5, {}};
    const Eigen::Isometry3d pose = world_from_camera();
    std::normal_distribution<double> noise(0.0, sigma_m);
    HeightMap map = make_height_map(camera);
    for (std::size_t cell = 0; cell < map.rays.size(); ++cell) {
      const Eigen::Vector3d from = pose.translation();
      const Eigen::Vector3d along = pose.linear() * Eigen::Vector3d(map.rays[cell].x(), map.rays[cell].y(), 1.0);
      double depth_m = -from.z() / along.z();
      const double a = along.tail<2>().squaredNorm();
      const double b = from.tail<2>().dot(along.tail<2>());
      const double root = b * b - a * (from.tail<2>().squaredNorm() - kRadius_m * kRadius_m);
      if (root > 0.0) depth_m = std::min(depth_m, (-b - std::sqrt(root)) / a);
      map.depth_m[cell] = static_cast<float>(depth_m + noise(random));
    }
    return map;
  }
};

// By the places of the noisy points themselves the strip that faces away most lies 0.8 mm too low; with one σ for the
// heights of all slopes the steep ones towards the camera lie up to 0.3 mm too high.
TEST(PlaneMap, ARidgesSurfaceLiesWhereItIsInSpiteOfNoiseFromItsSteepFlankToWhereItFacesAway) {
  std::mt19937 random(3);
  constexpr double kSigma_m = 0.0017;
  const Eigen::Isometry3d pose = Ridge::world_from_camera();
  const SupportPlane plane{pose.linear().transpose() * Eigen::Vector3d::UnitZ(), -pose.translation().z()};
  PlaneMap map = make_plane_map(plane, pose, Ridge::seen(kSigma_m, random), 0.0015);
  for (int i = 0; i < 20; ++i) fuse(map, Ridge::seen(kSigma_m, random), {}, pose);
  constexpr int kFrom_deg = -70, kPer_deg = 10;  // towards the camera, which is at −45°; its silhouette is at 45°
  std::array<double, 9> sum_m{};
  std::array<int, 9> count{};
  for (int row = 0; row < map.height; ++row) {
    for (int col = 0; col < map.width; ++col) {
      const float height_m = map.height_m[static_cast<std::size_t>(row) * static_cast<std::size_t>(map.width) +
                                          static_cast<std::size_t>(col)];
      const Eigen::Vector3d point =
          map.world_from_plane * Eigen::Vector3d((map.first_col + col + 0.5) * map.cell_m,
                                                 (map.first_row + row + 0.5) * map.cell_m, -height_m);
      const double deg = std::atan2(-point.y(), -point.z()) * 180.0 / std::numbers::pi;
      const double strip = std::floor((deg - kFrom_deg) / kPer_deg);
      const double off_m = point.tail<2>().norm() - Ridge::kRadius_m;
      if (std::isnan(height_m) || std::abs(point.x()) > 0.1 || strip < 0.0 || strip >= 9.0) continue;
      if (std::abs(off_m) > 0.5 * Ridge::kRadius_m) continue;  // the plane's
      sum_m[static_cast<std::size_t>(strip)] += off_m;
      ++count[static_cast<std::size_t>(strip)];
    }
  }
  for (std::size_t strip = 0; strip < sum_m.size(); ++strip) {
    EXPECT_GT(count[strip], 120) << strip;
    EXPECT_NEAR(sum_m[strip] / count[strip], 0.0, 0.00014) << strip;
  }
}

}  // namespace
}  // namespace tubetrack
