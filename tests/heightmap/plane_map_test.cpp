#include "tubetrack/heightmap/plane_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tubetrack {
namespace {

const Intrinsics kCamera{160, 120, 140.0, 140.0, 79.5, 59.5, {}};

/// A table in this plane, and a block of that height on it where |x|, |y| in the camera's frame are below 5 cm.
HeightMap table(const SupportPlane& plane, double block_m) {
  HeightMap map = make_height_map(kCamera);
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
  EXPECT_FALSE(largest_plane(make_height_map(kCamera)));
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

}  // namespace
}  // namespace tubetrack
