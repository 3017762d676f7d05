// Tubes too narrow for windows: surfels by their silhouettes.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "tubetrack/heightmap/normals.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

const Intrinsics kStripsCamera{640, 480, 570.0, 570.0, 319.5, 239.5, {}};
constexpr double kWall_m = 0.6;

/// A tube without ends.
struct Rod {
  Vector3d at_m;
  Vector3d along;  ///< unit
  double radius_m;

  /// z where the ray (x, y, 1) meets it first; empty where it does not.
  std::optional<double> depth_m(const Vector3d& ray) const {
    const Vector3d a = ray - ray.dot(along) * along;
    const Vector3d b = at_m - at_m.dot(along) * along;
    const double half = a.dot(b) / a.squaredNorm();
    const double root = half * half - (b.squaredNorm() - radius_m * radius_m) / a.squaredNorm();
    if (root < 0.0) return std::nullopt;
    return half - std::sqrt(root);
  }
};

/// `sigma_m` on every reading.
void see(HeightMap& map, const std::optional<Rod>& rod, double wall_m, double sigma_m) {
  std::vector<std::uint16_t> pixels(map.rays.size());
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const Vector3d ray(map.rays[i].x(), map.rays[i].y(), 1.0);
    const double z = (rod ? rod->depth_m(ray) : std::nullopt).value_or(wall_m);
    if (z > 0.0) pixels[i] = static_cast<std::uint16_t>(std::lround((z + sigma_m * noise(random)) / 1e-4));
  }
  update(map,
         {pixels.data(), kStripsCamera.width, kStripsCamera.height, static_cast<std::size_t>(kStripsCamera.width) * 2,
          1e-4},
         {}, {}, true);
}

HeightMap map_of(const std::optional<Rod>& rod, double wall_m, double sigma_m) {
  HeightMap map = make_height_map(kStripsCamera);
  see(map, rod, wall_m, sigma_m);
  return map;
}

/// What silhouettes alone give: no curvature passes the gate.
std::vector<Surfel> strips_of(SurfelFinder& finder, const HeightMap& map, std::span<const std::uint8_t> skip = {},
                              double widest_px = 16.0) {
  SurfelOptions options;
  options.gate_sigmas = 1e6;
  options.narrowest_strip_px = 8.0;
  options.widest_strip_px = widest_px;
  const auto surfels = finder.find(map, {}, options, skip);
  return {surfels.begin(), surfels.end()};
}

std::vector<Surfel> strips_of(const HeightMap& map, std::span<const std::uint8_t> skip = {}) {
  SurfelFinder finder;
  return strips_of(finder, map, skip);
}

std::vector<std::uint32_t> cells_of(const std::vector<Surfel>& surfels) {
  std::vector<std::uint32_t> cells;
  for (const Surfel& surfel : surfels) cells.push_back(surfel.cell);
  return cells;
}

/// 13.6 px wide, turned in the image and leaning away.
Rod rod_at(double turn_rad, double lean) {
  return {{0.01, -0.02, 0.42}, Vector3d(std::cos(turn_rad), std::sin(turn_rad), lean).normalized(), 0.005};
}

TEST(Strips, OfATubeOfAnyDirectionTheNormalsMeetOnItsAxisWithItsRadiusInTheirBands) {
  for (int i = 0; i < 12; ++i) {
    for (const double lean : {0.0, 0.5}) {
      const Rod rod = rod_at(0.26 * i + 0.05, lean);
      const auto surfels = strips_of(map_of(rod, kWall_m, 0.0012));
      EXPECT_GT(surfels.size(), 2000U) << i;
      int meet = 0;
      int in_band = 0;
      for (const Surfel& surfel : surfels) {
        const Vector3d center = surfel.position_m.cast<double>() + rod.radius_m * surfel.inward_normal.cast<double>();
        const Vector3d off = center - rod.at_m;
        // Within 0.4 radii: a reading's noise is 0.24 of them.
        meet += (off - off.dot(rod.along) * rod.along).norm() < 0.4 * rod.radius_m + 0.0012 ? 1 : 0;
        in_band += surfel.radius_min_m < rod.radius_m && surfel.radius_max_m > rod.radius_m ? 1 : 0;
        EXPECT_NEAR(surfel.inward_normal.norm(), 1.0F, 1e-3F);
      }
      EXPECT_GT(meet, 0.9 * static_cast<double>(surfels.size())) << i << ' ' << lean;
      EXPECT_GT(in_band, 0.95 * static_cast<double>(surfels.size())) << i << ' ' << lean;
    }
  }
}

TEST(Strips, BeforeNothingThatReturnsATubeShowsAsWell) {
  EXPECT_GT(strips_of(map_of(rod_at(0.4, 0.1), 0.0, 0.0012)).size(), 2000U);
}

TEST(Strips, ThereAreNoneOnAWallNorOnATubeThatIsWiderOrNarrowerThanAskedFor) {
  EXPECT_TRUE(strips_of(map_of(std::nullopt, kWall_m, 0.0012)).empty());
  for (const double radius_m : {0.0024, 0.009}) {
    Rod rod = rod_at(0.4, 0.1);
    rod.radius_m = radius_m;
    EXPECT_TRUE(strips_of(map_of(rod, kWall_m, 0.0)).empty()) << radius_m;
  }
}

TEST(Strips, ThereAreNoneOnATubeThatIsSkipped) {
  const Rod rod = rod_at(0.4, 0.1);
  const HeightMap map = map_of(rod, kWall_m, 0.0012);
  std::vector<std::uint8_t> skip(map.rays.size());
  for (std::size_t i = 0; i < skip.size(); ++i) {
    skip[i] = rod.depth_m(Vector3d(map.rays[i].x(), map.rays[i].y(), 1.0)) ? 1 : 0;
  }
  EXPECT_TRUE(strips_of(map, skip).empty());
}

TEST(Strips, AreThoseOfTheHeightsNowWhateverWasAskedForBefore) {
  HeightMap map = map_of(rod_at(0.3, 0.0), kWall_m, 0.0);
  SurfelFinder finder;
  const auto before = cells_of(strips_of(finder, map));
  EXPECT_EQ(cells_of(strips_of(finder, map)), before);
  EXPECT_TRUE(strips_of(finder, map, {}, 9.0).empty());
  EXPECT_EQ(cells_of(strips_of(finder, map)), before);
  see(map, rod_at(1.3, 0.0), kWall_m, 0.0);
  EXPECT_TRUE(strips_of(finder, map, {}, 0.0).empty());  // heights are taken, strips are not looked for
  const auto after = cells_of(strips_of(finder, map));
  EXPECT_EQ(after, cells_of(strips_of(map)));
  EXPECT_NE(after, before);
}

TEST(Strips, ComeInCellOrderOneACellBesideThoseOfCurvature) {
  Rod rod = rod_at(0.4, 0.1);
  rod.radius_m = 0.0058;
  SurfelOptions options;
  const HeightMap map = map_of(rod, kWall_m, 0.0);
  const auto curved = tube_surfels(map, {}, options);
  options.narrowest_strip_px = 8.0;
  options.widest_strip_px = 16.0;
  const auto all = tube_surfels(map, {}, options);
  EXPECT_FALSE(curved.empty());
  EXPECT_GT(all.size(), curved.size());
  EXPECT_TRUE(std::ranges::is_sorted(all, {}, &Surfel::cell));
  EXPECT_EQ(std::ranges::adjacent_find(all, {}, &Surfel::cell), all.end());
  for (const Surfel& surfel : curved) {
    const auto same = std::ranges::lower_bound(all, surfel.cell, {}, &Surfel::cell);
    ASSERT_NE(same, all.end());
    EXPECT_EQ(same->inward_normal, surfel.inward_normal);
  }
}

}  // namespace
}  // namespace tubetrack
