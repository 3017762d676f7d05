// The peers of the benchmarks do what they are timed for.
#include "peers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "scene_parts.hpp"
#include "speed_scenes.hpp"

namespace tubetrack::bench {
namespace {

[[maybe_unused]] RenderedFrame still_frame() {
  const SpeedScene speed = still_scene();
  return render_frame(speed.scene, 0, speed_noise(speed.scene.camera));
}

#ifdef TUBETRACK_PEER_OPENCV
TEST(OpencvNormals, OfAPlaneAreThePlanes) {
  SpeedScene speed = still_scene();
  speed.scene.tubes.clear();  // the wall is left
  const Eigen::Vector3f normal = Eigen::Vector3f(0.1F, 0.05F, -1.0F).normalized();
  const RenderedFrame rendered = render_frame(speed.scene, 0, DepthNoise::none());
  for (const OpencvNormals method : {OpencvNormals::fals, OpencvNormals::sri}) {
    const NormalsOfPoints work = opencv_normals(speed.scene.camera, method);
    work.prepare(depth_frame(rendered));
    work.run();
    for (int v = 40; v < 440; v += 50) {
      for (int u = 40; u < 600; u += 40) EXPECT_GT(work.at(u, v).dot(normal), std::cos(radians(1.0))) << u << " " << v;
    }
  }
}
#endif

std::vector<double> radii(const std::vector<Tube>& tubes) {
  std::vector<double> values;
  for (const Tube& tube : tubes) values.push_back(tube.radius_m);
  return values;
}

[[maybe_unused]] void expect_the_tube(const std::vector<Tube>& found) {
  EXPECT_TRUE(std::ranges::any_of(found, [](const Tube& tube) { return std::abs(tube.radius_m - 0.020) < 0.004; }))
      << ::testing::PrintToString(radii(found));
}

#ifdef TUBETRACK_PEER_PCL
TEST(PclCylinders, AreFoundWithEitherKindOfNormals) {
  const RenderedFrame rendered = still_frame();
  expect_the_tube(pcl_cylinders(depth_frame(rendered), speed_camera()));
  // Integral images smooth over the tube's sides: both of its straights in most frames, but 4 to 10 mm too thin.
  std::size_t pieces = 0;
  for (int k = 0; k < 4; ++k) {
    const SpeedScene speed = moving_tube_scene();
    const RenderedFrame moving = render_frame(scene_at(speed, k, 4), k, speed_noise(speed.scene.camera));
    const auto found = pcl_integral_cylinders(depth_frame(moving), speed_camera());
    pieces += found.size();
    for (const double radius_m : radii(found)) EXPECT_NEAR(radius_m, 0.013, 0.004);
  }
  EXPECT_GE(pieces, 6U);  // of 8
}
#endif

#ifdef TUBETRACK_PEER_CGAL
TEST(CgalCylinders, AreFound) {
  const RenderedFrame rendered = still_frame();
  expect_the_tube(cgal_cylinders(depth_frame(rendered), speed_camera()));
}
#endif

}  // namespace
}  // namespace tubetrack::bench
