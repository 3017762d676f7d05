#include "tubetrack/report/surface_mesh.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tubetrack {
namespace {

Tube straight_tube() {
  Tube tube;
  tube.radius_m = 0.01;
  for (int i = 0; i <= 40; ++i) tube.centerline_m.emplace_back(0.005 * i, 0.0, 0.0);
  tube.segments = {{Segment::Type::straight, 0.0, 0.2, 0.0, 0.0}};
  return tube;
}

TEST(SurfaceErrors, AreDistancesToTheSurfaceInsideAndOutside) {
  SurfaceMesh mesh;
  mesh.points_m = {{0.1, 0.01, 0.0}, {0.1, 0.0, 0.008}, {0.1, 0.0, -0.013}, {0.1, 0.0, 0.02}};
  const Tube tubes[] = {straight_tube()};
  const SurfaceErrors errors = color_by_distance(mesh, tubes);
  EXPECT_NEAR(mesh.distance_m[0], 0.0, 1e-7);
  EXPECT_NEAR(mesh.distance_m[1], 0.002, 1e-7);
  EXPECT_NEAR(mesh.distance_m[2], 0.003, 1e-7);
  EXPECT_TRUE(std::isnan(mesh.distance_m[3]));
  EXPECT_EQ(errors.on_tubes, 3U);
  EXPECT_EQ(errors.off_tubes, 1U);
  EXPECT_NEAR(errors.min_m, 0.0, 1e-9);
  EXPECT_NEAR(errors.median_m, 0.002, 1e-9);
  EXPECT_NEAR(errors.max_m, 0.003, 1e-9);
}

TEST(SurfaceErrors, OfTheTubesOwnSurfaceAreNone) {
  const Tube tubes[] = {straight_tube()};
  SurfaceMesh mesh = surface_of(tubes[0]);
  mesh.points_m.resize(48 * 100);  // the caps' middles are on no tube's side
  EXPECT_LT(color_by_distance(mesh, tubes).max_m, 1e-9);
}

}  // namespace
}  // namespace tubetrack
