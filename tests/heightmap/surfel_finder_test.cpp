#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "heightmap/slow_surfels.hpp"
#include "heightmap/surfel_stream.hpp"
#include "tubetrack/heightmap/normals.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

TEST(SurfelFinder, FindsWhatTheSlowOneFinds) {
  Intrinsics distorted = kStreamCamera;
  distorted.distortion = {0.1, -0.05, 0.001, -0.002, 0.02};
  struct Case {
    Intrinsics camera;
    double hole_share;
    double noise_scale;
  };
  for (const Case& c : {Case{kStreamCamera, 0.0, 1.0}, Case{kStreamCamera, 0.1, 0.0}, Case{kStreamCamera, 0.3, 1.0},
                        Case{distorted, 0.0, 1.0}, Case{distorted, 0.1, 1.0}}) {
    Stream stream;
    stream.camera = c.camera;
    stream.hole_share = c.hole_share;
    stream.noise_scale = c.noise_scale;
    HeightMap map = make_height_map(c.camera);
    update(map, stream.next(), {}, {}, true);
    const auto fast = tube_surfels(map, {}, {});
    const auto slow = slow_tube_surfels(map, {}, {});
    const Comparison result = compare(fast, slow);
    std::printf(
        "%s, holes %.1f, noise %.0f: %zu and %zu surfels, %zu in both, %zu in one; normals %.1e rad, "
        "positions %.1e m, bands %.1e\n",
        c.camera.has_distortion() ? "distorted" : "pinhole", c.hole_share, c.noise_scale, fast.size(), slow.size(),
        result.both, result.one_only, result.worst_angle_rad, result.worst_position_m, result.worst_band);
    EXPECT_GT(slow.size(), 1000U);
    // With distortion and holes the moments of the pixels stand in for those of the rays.
    EXPECT_LE(result.one_only, slow.size() / (c.camera.has_distortion() ? 100 : 500));
    EXPECT_LE(result.worst_angle_rad, 6e-4);  // heights are rounded to 2⁻¹⁶ /m
    EXPECT_LE(result.worst_position_m, 1e-5);
  }
}

// Odd rows are searched where the row above has a surfel nearby.
TEST(SurfelFinder, FindsInOddRowsWhatGoesOnFromTheRowAbove) {
  Stream stream;
  HeightMap map = make_height_map(kStreamCamera);
  update(map, stream.next(), {}, {}, true);
  std::vector<int> columns_above;
  std::size_t even = 0, odd = 0, row_above = 0;
  for (const Surfel& surfel : tube_surfels(map, {}, {})) {
    const std::size_t v = surfel.cell / 320;
    const int u = static_cast<int>(surfel.cell % 320);
    if (v % 2 == 0) {
      ++even;
      if (v != row_above) columns_above.clear();
      row_above = v;
      columns_above.push_back(u);
    } else {
      ++odd;
      EXPECT_EQ(v, row_above + 1);
      EXPECT_TRUE(std::ranges::any_of(columns_above, [&](int above) { return std::abs(above - u) < 24; }));
    }
  }
  EXPECT_GT(even, 1000U);
  EXPECT_NEAR(static_cast<double>(odd), static_cast<double>(even), 0.03 * static_cast<double>(even));
}

}  // namespace
}  // namespace tubetrack
