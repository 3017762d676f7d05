#include "scan_grid.hpp"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <random>
#include <vector>

#include "scan_fit.hpp"

namespace tubetrack {
namespace {

constexpr double kScannedRadius_m = 0.01;

/// Points all over a cylinder around the x axis, 0.2 m long.
std::vector<ScanSurfel> cylinder(int count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<ScanSurfel> surfels;
  for (int i = 0; i < count; ++i) {
    const double angle_rad = 2.0 * std::numbers::pi * unit(random);
    const Eigen::Vector3d outward(0.0, std::cos(angle_rad), std::sin(angle_rad));
    ScanSurfel surfel;
    surfel.position_m = (Eigen::Vector3d(0.2 * unit(random), 0.0, 0.0) + kScannedRadius_m * outward).cast<float>();
    surfel.inward_normal = -outward.cast<float>();
    surfels.push_back(surfel);
  }
  return surfels;
}

TEST(ScanGrid, EveryCellIsInOneBucket) {
  const SurfelGrid grid = merged_by_cell(cylinder(5000), {}, 0.3 * kScannedRadius_m);
  std::uint32_t next = 0;
  for (const SurfelBucket& bucket : grid.buckets) {
    EXPECT_EQ(bucket.begin, next);
    EXPECT_EQ(std::popcount(bucket.cells), static_cast<int>(bucket.end - bucket.begin));
    for (next = bucket.begin; next < bucket.end; ++next)
      EXPECT_LT((grid.surfels[next].position_m.cast<double>() - bucket.center_m).norm(),
                1.001 * grid.bucket_radius_m());
  }
  EXPECT_EQ(next, grid.surfels.size());
}

/// The places in the grid of the surfels' cells, by a flag for each in turn; so many where a surfel has none.
std::vector<std::size_t> places_in(const SurfelGrid& grid, const std::vector<ScanSurfel>& surfels) {
  std::vector<std::size_t> places(surfels.size(), 0);
  int bits = 1;
  while (grid.surfels.size() >> bits != 0) ++bits;
  for (int bit = -1; bit < bits; ++bit) {
    std::vector<char> flags(grid.surfels.size(), 1), members(surfels.size(), 0);
    for (std::size_t k = 0; k < flags.size() && bit >= 0; ++k) flags[k] = static_cast<char>(k >> bit & 1);
    flag_members(grid, flags, surfels, members);
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      if (bit < 0 && members[i] == 0) places[i] = grid.surfels.size();
      if (bit >= 0 && places[i] != grid.surfels.size() && members[i] != 0) places[i] |= std::size_t{1} << bit;
    }
  }
  return places;
}

TEST(ScanGrid, EverySurfelIsInTheCellOfItsPlace) {
  const std::vector<ScanSurfel> surfels = cylinder(5000);
  const SurfelGrid grid = merged_by_cell(surfels, {}, 0.3 * kScannedRadius_m);
  const std::vector<std::size_t> places = places_in(grid, surfels);
  std::vector<std::uint32_t> counts(grid.surfels.size(), 0);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    ASSERT_LT(places[i], grid.surfels.size());
    ++counts[places[i]];
    const float away_m = (grid.surfels[places[i]].position_m - surfels[i].position_m).norm();
    EXPECT_LT(away_m, std::sqrt(3.0) * grid.cell_m);
  }
  EXPECT_EQ(std::count(counts.begin(), counts.end(), 0U), 0);
}

TEST(ScanGrid, ManySurfelsThatAreSortedInSharesAreInTheCellsOfTheirPlaces) {
  const std::vector<ScanSurfel> surfels = cylinder(300'000);
  const double cell_m = 0.05 * kScannedRadius_m;
  const SurfelGrid grid = merged_by_cell(surfels, {}, cell_m);
  EXPECT_TRUE(std::is_sorted(grid.keys.begin(), grid.keys.end()));
  EXPECT_EQ(std::adjacent_find(grid.keys.begin(), grid.keys.end()), grid.keys.end());
  const std::vector<std::size_t> places = places_in(grid, surfels);
  for (std::size_t i = 0; i < surfels.size(); ++i)
    ASSERT_LT((grid.surfels[places[i]].position_m - surfels[i].position_m).norm(), std::sqrt(3.0) * cell_m);
  // Half of them, which are sorted in one go, share cells as they do among all.
  std::vector<char> second_half(surfels.size(), 0);
  std::fill(second_half.begin() + 150'000, second_half.end(), 1);
  const std::vector<std::size_t> of_half = places_in(merged_by_cell(surfels, second_half, cell_m), surfels);
  for (std::size_t i = 1; i < 150'000; ++i) EXPECT_EQ(places[i] == places[i - 1], of_half[i] == of_half[i - 1]);
}

TEST(ScanGrid, WhereSurfelsAreOnALineDoesNotDependOnTheVectors) {
  const SurfelGrid grid = merged_by_cell(cylinder(20'000), {}, 0.3 * kScannedRadius_m);
  const ScanLine line =
      scan_line_along({{-0.02, 0.0, 0.0}, {0.1, 0.002, 0.001}, {0.22, 0.0, 0.0}}, kScannedRadius_m, false);
  const std::vector<SurfacePoint> best = points_near(grid, {}, line);
  ASSERT_GT(best.size(), 1000U);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    const std::vector<SurfacePoint> points = points_near(grid, {}, line);
    ASSERT_EQ(points.size(), best.size());
    for (std::size_t i = 0; i < best.size(); ++i) {
      EXPECT_EQ(points[i].t, best[i].t) << hwy::TargetName(target);
      EXPECT_EQ(points[i].surfel, best[i].surfel);
      EXPECT_EQ(points[i].distance_m, best[i].distance_m);
      EXPECT_EQ(points[i].inward, best[i].inward);
    }
  }
  hwy::SetSupportedTargetsForTest(0);
}

TEST(ScanGrid, ALineThatMovedALittleHasItsSurfelsWhereALookAtAllOfThemFindsThem) {
  const SurfelGrid grid = merged_by_cell(cylinder(20'000), {}, 0.3 * kScannedRadius_m);
  const ScanLine line =
      scan_line_along({{-0.02, 0.0, 0.0}, {0.1, 0.002, 0.001}, {0.22, 0.0, 0.0}}, kScannedRadius_m, false);
  ScanLine moved = line;
  for (Eigen::Vector3d& control : moved.model.spline.control_m)
    control += Eigen::Vector3d(0.15, 0.1, -0.05) * kScannedRadius_m;
  std::vector<SurfacePoint> again = points_near(grid, {}, line);
  place_again(grid, moved, again);
  const std::vector<SurfacePoint> anew = points_near(grid, {}, moved);
  std::size_t both = 0;
  for (std::size_t i = 0, k = 0; i < anew.size() && k < again.size();) {
    if (anew[i].surfel != again[k].surfel) {
      ++(anew[i].surfel < again[k].surfel ? i : k);
      continue;
    }
    EXPECT_NEAR(anew[i].t, again[k].t, 0.012);
    EXPECT_NEAR(anew[i].distance_m, again[k].distance_m, 1e-4F * kScannedRadius_m);
    ++both, ++i, ++k;
  }
  EXPECT_GT(both, anew.size() * 97 / 100);  // the others are at the border of what belongs to it
  EXPECT_GT(both, again.size() * 97 / 100);
}

TEST(ScanGrid, WhatIsLeftOutIsInNoCell) {
  const std::vector<ScanSurfel> surfels = cylinder(1000);
  std::vector<char> left_out(surfels.size(), 0);
  for (std::size_t i = 0; i < surfels.size(); ++i) left_out[i] = surfels[i].position_m.x() > 0.1F ? 1 : 0;
  const double cell_m = 0.0005 * kScannedRadius_m;  // one for each
  const SurfelGrid grid = merged_by_cell(surfels, left_out, cell_m);
  const std::vector<std::size_t> places = places_in(grid, surfels);
  for (std::size_t i = 0; i < surfels.size(); ++i) EXPECT_EQ(places[i] == grid.surfels.size(), left_out[i] != 0);
}

TEST(ScanGrid, OppositeWallsThatCancelOutAreInNoCell) {
  std::vector<ScanSurfel> surfels = cylinder(1000);
  const std::size_t count = surfels.size();
  for (std::size_t i = 0; i < count; i += 2) {
    surfels.push_back(surfels[i]);
    surfels.back().inward_normal *= -1.0F;
  }
  const SurfelGrid grid = merged_by_cell(surfels, {}, 0.0005 * kScannedRadius_m);
  EXPECT_EQ(grid.surfels.size(), count / 2);
  const std::vector<std::size_t> places = places_in(grid, surfels);
  for (std::size_t i = 0; i < surfels.size(); ++i)
    EXPECT_EQ(places[i] == grid.surfels.size(), i >= count || i % 2 == 0);
}

TEST(ScanGrid, BucketsInABoxAreAllThatHaveTheirCentreInIt) {
  const std::vector<ScanSurfel> surfels = cylinder(20000);
  std::vector<std::uint32_t> numbers;
  const SurfelGrid grid = merged_by_cell(surfels, {}, 0.05 * kScannedRadius_m);
  for (const double from_m : {-0.1, 0.0, 0.07, 0.19, 0.3}) {
    const Eigen::AlignedBox3d box(Eigen::Vector3d(from_m, 0.0, -0.02), Eigen::Vector3d(from_m + 0.02, 0.004, 0.02));
    grid.buckets_in(box, numbers);
    EXPECT_TRUE(std::is_sorted(numbers.begin(), numbers.end()));
    for (std::uint32_t i = 0; i < grid.buckets.size(); ++i) {
      if (!box.contains(grid.buckets[i].center_m)) continue;
      EXPECT_TRUE(std::binary_search(numbers.begin(), numbers.end(), i)) << i;
    }
  }
}

TEST(ScanGrid, MeansOfCellsKnowHowFarTheCurvedSurfaceStandsOutOverThem) {
  const std::vector<ScanSurfel> surfels = cylinder(40000);
  const SurfelGrid grid = merged_by_cell(surfels, {}, 0.4 * kScannedRadius_m);
  const ScanLine line = scan_line_along({{-0.05, 0.0, 0.0}, {0.25, 0.0, 0.0}}, kScannedRadius_m, false);
  double means_m = 0.0, surface_m = 0.0, worst_m = 0.0;
  const std::vector<SurfacePoint> points = points_near(grid, {}, line);
  ASSERT_GT(points.size(), grid.surfels.size() * 95 / 100);
  for (const SurfacePoint& point : points) {
    means_m += (point.distance_m - point.lift_m) / static_cast<double>(points.size());
    surface_m += point.distance_m / static_cast<double>(points.size());
    worst_m = std::max(worst_m, std::abs(point.distance_m - kScannedRadius_m));
  }
  std::printf("means lie at %.5f R, the surface at %.6f R, worst %.5f R off\n", means_m / kScannedRadius_m,
              surface_m / kScannedRadius_m, worst_m / kScannedRadius_m);
  EXPECT_LT(means_m, 0.997 * kScannedRadius_m);
  EXPECT_NEAR(surface_m, kScannedRadius_m, 0.00003 * kScannedRadius_m);
  EXPECT_LT(worst_m, 0.00012 * kScannedRadius_m);
}

}  // namespace
}  // namespace tubetrack
