#include "tubetrack/replay/depth_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "measure.hpp"
#include "tubetrack/replay/render.hpp"

namespace tubetrack {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

DepthNoise only(bool DepthNoise::* part) {
  DepthNoise noise = DepthNoise::none();
  noise.*part = true;
  return noise;
}

ExactPixels flat_wall(double depth_m, double incidence_rad) {
  ExactPixels exact;
  exact.width = 640;
  exact.height = 480;
  exact.depth_m.assign(640 * 480, depth_m);
  exact.seen_depth_m = exact.depth_m;
  exact.incidence_rad.assign(640 * 480, incidence_rad);
  return exact;
}

/// DESIGN §5, written out.
double pinned_sigma(double z, double theta) {
  theta = std::min(theta, 85.0 * kDegree);
  const double left = std::numbers::pi / 2.0 - theta;
  return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4) + 0.0001 / std::sqrt(z) * theta * theta / (left * left);
}

TEST(DepthNoise, AxialSigmaOfAFlatWallIsTheFormulaAtEveryDepthAndIncidence) {
  for (const double z : {0.4, 0.8, 1.5, 3.0, 5.0}) {
    for (const double degrees : {0.0, 45.0, 70.0, 84.0, 89.0}) {
      const MeasuredPixels seen = measure(flat_wall(z, degrees * kDegree), only(&DepthNoise::axial), 3);
      const double count = static_cast<double>(seen.depth_m.size());
      double sum = 0.0;
      double squares = 0.0;
      double neighbours = 0.0;
      for (std::size_t i = 0; i < seen.depth_m.size(); ++i) {
        const double e = seen.depth_m[i] - z;
        sum += e;
        squares += e * e;
        if (i > 0) neighbours += e * (seen.depth_m[i - 1] - z);
      }
      const double sigma = pinned_sigma(z, degrees * kDegree);
      EXPECT_NEAR(std::sqrt(squares / count) / sigma, 1.0, 0.006) << z << " m, " << degrees << " degrees";
      EXPECT_NEAR(sum / count / sigma, 0.0, 4.5 / std::sqrt(count)) << z << " m, " << degrees << " degrees";
      EXPECT_NEAR(neighbours / count / (sigma * sigma), 0.0, 4.5 / std::sqrt(count)) << "neighbours are independent";
    }
  }
}

TEST(DepthNoise, DisparityIsRoundedToAnEighthOfAPixel) {
  DepthNoise noise = only(&DepthNoise::quantisation);
  noise.axial = true;
  const MeasuredPixels seen = measure(flat_wall(1.3, 0.0), noise, 1);
  const MeasuredPixels unrounded = measure(flat_wall(1.3, 0.0), only(&DepthNoise::axial), 1);
  for (std::size_t i = 0; i < seen.depth_m.size(); ++i) {
    const double eighths = 0.075 * 570.0 / seen.depth_m[i] * 8.0;
    ASSERT_NEAR(eighths, std::round(eighths), 1e-9);
    ASSERT_LE(std::abs(eighths - 0.075 * 570.0 / unrounded.depth_m[i] * 8.0), 0.5 + 1e-9);
  }
}

TEST(DepthNoise, NothingReturnsAbove80DegreesAndAllBelow) {
  const auto returns = [](double degrees) {
    const MeasuredPixels seen = measure(flat_wall(0.8, degrees * kDegree), only(&DepthNoise::dropout), 1);
    return std::count_if(seen.depth_m.begin(), seen.depth_m.end(), [](double z) { return z > 0.0; });
  };
  EXPECT_EQ(returns(80.01), 0);
  EXPECT_EQ(returns(79.99), 640 * 480);
}

/// Left half at 0.8 m, right half at 1.2 m.
ExactPixels step() {
  ExactPixels exact = flat_wall(0.8, 0.0);
  for (std::size_t i = 0; i < exact.depth_m.size(); ++i) {
    if (i % 640 >= 320) exact.depth_m[i] = 1.2;
  }
  exact.seen_depth_m = exact.depth_m;
  return exact;
}

TEST(DepthNoise, HalfOfTheEdgePixelsAreLostAnd30PercentOfTheRestMixed) {
  DepthNoise noise = only(&DepthNoise::dropout);
  noise.mixed = true;
  const ExactPixels exact = step();
  double lost = 0.0;
  double mixed = 0.0;
  double total = 0.0;
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    const MeasuredPixels seen = measure(exact, noise, seed);
    for (std::size_t i = 0; i < seen.depth_m.size(); ++i) {
      const std::size_t u = i % 640;
      if (u < 319 || u > 320) {
        ASSERT_EQ(seen.depth_m[i], exact.depth_m[i]) << "column " << u;
        continue;
      }
      total += 1.0;
      if (seen.depth_m[i] == 0.0) lost += 1.0;
      if (seen.depth_m[i] == 0.0 || seen.mixed[i] == 0) continue;
      mixed += 1.0;
      ASSERT_GT(seen.depth_m[i], 0.8);
      ASSERT_LT(seen.depth_m[i], 1.2);
    }
  }
  EXPECT_NEAR(lost / total, 0.5, 4.5 * 0.5 / std::sqrt(total));
  EXPECT_NEAR(mixed / (total - lost), 0.3, 4.5 * 0.46 / std::sqrt(total - lost));
}

TEST(DepthNoise, ASteepSurfaceIsNoDepthEdge) {
  ExactPixels exact = flat_wall(0.8, 79.0 * kDegree);
  for (std::size_t i = 0; i < exact.depth_m.size(); ++i) {  // the depths of a plane at 79° in the view's middle
    const double x = (static_cast<double>(i % 640) - 319.5) / 570.0;
    exact.depth_m[i] = std::abs(x) < 0.02 ? 0.8 / (1.0 - x * std::tan(79.0 * kDegree)) : 0.8;
  }
  exact.seen_depth_m = exact.depth_m;
  const MeasuredPixels seen = measure(exact, only(&DepthNoise::dropout), 1);
  for (std::size_t u = 312; u < 328; ++u) {
    for (std::size_t v = 0; v < 480; ++v) ASSERT_GT(seen.depth_m[v * 640 + u], 0.0) << u;
  }
}

TEST(DepthNoise, JitterOfASlantedWallIsHalfAPixelOfItsSlope) {
  Scene scene;
  const double slope = std::tan(60.0 * kDegree);
  scene.solids = {{PlaneShape{{0.0, 0.0, 1.0}, {std::sin(60.0 * kDegree), 0.0, -std::cos(60.0 * kDegree)}}, {}}};
  DepthNoise noise = only(&DepthNoise::jitter);
  noise.metres_per_unit = 0.00005;
  const RenderedFrame seen = render_frame(scene, 0, noise);
  double squares = 0.0;
  double count = 0.0;
  for (int v = 0; v < 480; ++v) {
    for (int u = 280; u < 360; ++u) {
      // 1/z is linear in u on a plane, so the error in 1/z is the jitter times slope / f.
      const double z = seen.depth[static_cast<std::size_t>(v * 640 + u)] * noise.metres_per_unit;
      const double exact = 1.0 - (u - 319.5) / 570.0 * slope;
      const double jitter_px = (1.0 / z - exact) * 570.0 / slope;
      squares += jitter_px * jitter_px;
      count += 1.0;
    }
  }
  EXPECT_NEAR(std::sqrt(squares / count), 0.5, 0.01);
}

TEST(DepthNoise, TheProjectorsShadowIsWhereASphereHidesTheWallFromIt) {
  Scene scene;
  const Eigen::Vector3d center(0.05, -0.03, 0.7);
  scene.solids = {{PlaneShape{{0.0, 0.0, 1.2}, -Eigen::Vector3d::UnitZ()}, {}}, {SphereShape{center, 0.06}, {}}};
  const ExactImage image = exact_image(scene, 0);
  const RenderedFrame seen = render_frame(scene, 0, only(&DepthNoise::shadow));
  const Eigen::Vector3d projector(0.075, 0.0, 0.0);
  int dark = 0;
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const auto pixel = static_cast<std::size_t>(v * 640 + u);
      const Eigen::Vector3d point = image.depth_m[pixel] * normalized_ray(scene.camera, u, v).homogeneous();
      const Eigen::Vector3d way = (point - projector).normalized();
      const double nearest = (center - projector).cross(way).norm();
      const bool on_sphere = image.object[pixel] == 1;
      const bool hidden = on_sphere ? (point - center).dot(way) > 0.0 : nearest < 0.06;
      ASSERT_EQ(seen.depth[pixel] == 0, hidden) << u << ", " << v;
      if (hidden) ++dark;
    }
  }
  EXPECT_GT(dark, 1000);
}

TEST(DepthNoise, SameSeedSameBytesAndOtherSeedsAndFramesDiffer) {
  Scene scene = preset_scene("crossing").value();
  const RenderedFrame first = render_frame(scene, 3, {});
  EXPECT_EQ(first.depth, render_frame(scene, 3, {}).depth);
  EXPECT_NE(first.depth, render_frame(scene, 4, {}).depth);
  scene.seed = 2;
  EXPECT_NE(first.depth, render_frame(scene, 3, {}).depth);
}

TEST(DepthNoise, SwitchingAPartOffLeavesTheOthersAsTheyWere) {
  const Scene scene = preset_scene("crossing").value();
  const RenderedFrame all = render_frame(scene, 0, {});
  DepthNoise no_shadow;
  no_shadow.shadow = false;
  const RenderedFrame lit = render_frame(scene, 0, no_shadow);
  for (std::size_t i = 0; i < all.depth.size(); ++i) {
    if (all.depth[i] != 0) {
      ASSERT_EQ(all.depth[i], lit.depth[i]);
    }
  }
}

TEST(DepthNoise, WithoutNoiseOnlyTheRoundingTo16BitsIsLeft) {
  const Scene scene = preset_scene("bent").value();
  const ExactImage image = exact_image(scene, 0);
  const RenderedFrame seen = render_frame(scene, 0, DepthNoise::none());
  for (std::size_t i = 0; i < seen.depth.size(); ++i) {
    ASSERT_NEAR(seen.depth[i] * 0.0001, image.depth_m[i], 0.00005 + 1e-12);
  }
}

}  // namespace
}  // namespace tubetrack
