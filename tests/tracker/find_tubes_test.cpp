// Which peaks are worth a fit.
#include "tubetrack/tracker/find_tubes.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <utility>
#include <vector>

#include "tracker/tube_scene.hpp"
#include "tubetrack/heightmap/normals.hpp"
#include "tubetrack/tracker/trace.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

/// Of all peaks in a map's votes, best first: whether they are sparse.
std::vector<bool> sparse_peaks(const HeightMap& map) {
  const std::vector<Surfel> surfels = tube_surfels(map, {}, {});
  const double cell_m = matching_cell_m(surfels, kVga.fx_px);
  AccumulationMap votes(cell_m);
  for (const Surfel& surfel : surfels) votes.add(vote_record(surfel, cell_m));
  std::vector<bool> sparse;
  for (const VoxelIndex& peak : votes.peaks(12, 1)) {
    const Voxel box = votes.box(peak, 1);
    const double radius_m = cell_m * box.steps / box.votes;
    sparse.push_back(is_sparse(box, radius_m, cell_m, kVga.fx_px / votes.center_of(peak).z()));
  }
  return sparse;
}

HeightMap with_noise(HeightMap map, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss;
  for (std::size_t i = 0; i < map.rays.size(); ++i) {
    if (map.count[i] == 0) continue;
    const double sigma_m = axial_sigma_m({}, map.depth_m[i], 0.0);
    map.depth_m[i] += static_cast<float>(sigma_m * gauss(random));
    map.inverse_depth_per_m[i] = 1.0F / map.depth_m[i];
    const double w = map.inverse_depth_per_m[i];
    map.variance_per_m2[i] = static_cast<float>(sigma_m * sigma_m * w * w * w * w);
  }
  return map;
}

TEST(SparsePeaks, TheBestOfATubeOfAnyRadiusAndDirectionIsNone) {
  for (const double radius_m : {0.012, 0.02, 0.04, 0.08}) {
    for (const double depth_m : {0.6, 0.9}) {
      for (const Vector3d& raw : {Vector3d(1, 0, 0), Vector3d(0.3, 1, 0), Vector3d(1, -0.7, 0.6)}) {
        const HeightMap map = cylinder_map(kVga, Vector3d(0.0, 0.0, depth_m), raw.normalized(), 0.15, radius_m);
        const std::vector<bool> sparse = sparse_peaks(with_noise(map, 3));
        ASSERT_FALSE(sparse.empty());
        EXPECT_FALSE(sparse[0]) << radius_m << " at " << depth_m;
      }
    }
  }
}

TEST(SparsePeaks, AreMostOfThoseOfANoisySlantedTable) {
  const NoiseModel noise;
  std::mt19937_64 random(7);
  std::normal_distribution<double> gauss;
  HeightMap map = make_height_map(kVga);
  const Vector3d normal(0.0, std::sqrt(0.5), std::sqrt(0.5));
  const double px = noise.lateral_px / kVga.fx_px;
  for (std::size_t i = 0; i < map.rays.size(); ++i) {
    const Vector3d ray(map.rays[i].x() + px * gauss(random), map.rays[i].y() + px * gauss(random), 1.0);
    map.depth_m[i] = static_cast<float>(0.8 * normal.z() / normal.dot(ray));
    map.count[i] = 1;
  }
  const std::vector<bool> sparse = sparse_peaks(with_noise(std::move(map), 4));
  const auto refused = std::count(sparse.begin(), sparse.end(), true);
  std::printf("%td of %zu peaks are sparse\n", refused, sparse.size());
  EXPECT_GT(sparse.size(), 50U);
  EXPECT_GT(static_cast<double>(refused), 0.9 * static_cast<double>(sparse.size()));
}

// What it misses is left to grow, span by span.
TEST(TraceOn, GoesOnBehindWhatHidesTwoRadiiOfATubeAndStopsAtItsEnd) {
  constexpr double kRadius_m = 0.02;
  const Vector3d middle(0.0, 0.0, 0.8);
  const HeightMap map = with_noise(cylinder_map(kVga, middle, Vector3d::UnitX(), 0.15, kRadius_m), 4);
  const std::vector<Surfel> surfels = tube_surfels(map, {}, {});
  const double cell_m = matching_cell_m(surfels, kVga.fx_px);
  AccumulationMap votes(cell_m);
  for (const Surfel& surfel : surfels) {
    if (std::abs(surfel.position_m.x()) > kRadius_m) votes.add(vote_record(surfel, cell_m));
  }
  RecycledVector<Vector3d> line_m;
  for (const double x_m : {-0.12, -0.10, -0.08}) line_m.emplace_back(x_m, 0.0, 0.8);
  trace_on(votes, kRadius_m, 12, {kRadius_m, 0.5 * kRadius_m}, line_m);
  EXPECT_GT(line_m.back().x(), 0.11);
  EXPECT_LT(line_m.back().x(), 0.17);
  for (const Vector3d& point_m : line_m) EXPECT_LT((point_m - middle).tail<2>().norm(), 0.5 * kRadius_m);
}

}  // namespace
}  // namespace tubetrack
