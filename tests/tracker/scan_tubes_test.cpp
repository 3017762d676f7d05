#include "tubetrack/tracker/scan_tubes.hpp"

#include <gmock/gmock.h>
#include <hwy/targets.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <numbers>

#include "scan_bodies.hpp"
#include "tubetrack/replay/scan_surfels.hpp"
#include "tubetrack/tracker/joints.hpp"

namespace tubetrack {
namespace {

using namespace bench;
using ::testing::HasSubstr;

constexpr double kRadius_m = 0.006;
constexpr double kStep_m = 0.001;
constexpr double kPi = std::numbers::pi;

/// Four bends in as many planes, about 90 radii long, as the paper's tubes are.
PartChain bent_tube() {
  PartChain chain;
  chain.start_m = {0.10, 0.12, 0.2};
  chain.direction = Eigen::Vector3d(1.0, 0.2, 0.1).normalized();
  chain.towards = Eigen::Vector3d(-0.2, 1.0, 0.0).normalized();
  chain.towards = (chain.towards - chain.towards.dot(chain.direction) * chain.direction).normalized();
  chain.bends = {{0.10, 0.0, 1.2, 0.030}, {0.06, 1.0, 0.8, 0.040}, {0.08, -2.0, 1.6, 0.024}, {0.05, 0.5, 1.0, 0.030}};
  chain.closing_m = 0.09;
  return chain;
}

/// Two bends in a plane and a gentle rise, seen well from above.
PartChain lying_tube() {
  PartChain chain;
  chain.start_m = {0.03, 0.03, -0.02};
  chain.direction = Eigen::Vector3d(1.0, 0.1, 0.05).normalized();
  chain.towards = Eigen::Vector3d(-0.1, 1.0, 0.0).normalized();
  chain.bends = {{0.10, 0.0, 1.2, 0.036}, {0.08, kPi, 0.9, 0.030}};
  chain.closing_m = 0.10;
  return chain;
}

TubeFrame tubes_of(const Scan& scan, ScanTubesConfig config = {}) {
  const auto surfels = surfels_of(scan);
  config.grid_step_m = scan.grid_step_m;
  if (!config.radius_m) {
    const RadiusRange range = default_radius_range(scan, surfels);
    config.radius_min_m = range.min_m;
    config.radius_max_m = range.max_m;
  }
  EXPECT_TRUE(validate(config));
  TubeFrame frame = find_scan_tubes(surfels, config);
  const StageTimes& t = frame.stages;
  std::printf(
      "  %zu surfels, step %.3f mm, radii %.1f to %.1f mm: %.0f ms (merge %.0f, votes %.0f, trace %.0f, fit "
      "%.0f, parts %.0f), %zu tubes\n",
      surfels.size(), 1e3 * scan.grid_step_m, 1e3 * config.radius_min_m, 1e3 * config.radius_max_m, frame.latency_ms,
      t.normals_ms, t.accumulate_ms, t.trace_ms, t.fit_ms, t.segment_ms, frame.tubes.size());
  for (std::size_t i = 1; i < frame.tubes.size(); ++i) {
    const Tube& tube = frame.tubes[i];
    std::cout << "  tube " << i + 1 << ": radius " << 1e3 * tube.radius_m << ", length " << 1e3 * tube.length_m
              << ", from " << 1e3 * tube.centerline_m.front().transpose() << " mm\n";
  }
  return frame;
}

/// One tube, along the chain, its line's RMS within `voxels` of the scan's step.
void expect_tube(const TubeFrame& frame, const PartChain& chain, double step_m, double voxels) {
  ASSERT_EQ(frame.tubes.size(), 1U);
  const Tube& tube = frame.tubes.front();
  const LineError error = error_of(tube.centerline_m, chain);
  double sigma_m = 0.0;
  for (const double sigma : tube.sigma_m) sigma_m += sigma / static_cast<double>(tube.sigma_m.size());
  std::printf(
      "  rms %.4f, max %.4f voxels; radius %+.4f voxels (sigma %.4f); mean sigma %.4f; length %.2f of %.2f mm, "
      "%zu segments\n",
      error.rms_m / step_m, error.max_m / step_m, (tube.radius_m - kRadius_m) / step_m, tube.radius_sigma_m / step_m,
      sigma_m / step_m, 1e3 * tube.length_m, 1e3 * length_of(chain), tube.segments.size());
  EXPECT_LE(error.rms_m, voxels * step_m);
  EXPECT_LE(error.max_m, 5.0 * voxels * step_m);
  EXPECT_NEAR(tube.length_m, length_of(chain), 2.0 * step_m + 0.05 * kRadius_m);
}

TEST(ScanTubes, FullMeshIsFoundWithinATenthOfAVoxel) {
  std::mt19937_64 random(1);
  const PartChain chain = bent_tube();
  const TubeFrame frame = tubes_of(mesh_of_tube(chain, {kRadius_m, kStep_m}, random));
  EXPECT_EQ(frame.frame_id, "scan");
  EXPECT_EQ(frame.status, TrackStatus::ok);
  expect_tube(frame, chain, kStep_m, 0.1);
  ASSERT_EQ(frame.tubes.front().bend_table.lra.size(), 5U);
}

TEST(ScanTubes, NoisyMeshIsFoundWithinATenthOfAVoxel) {
  std::mt19937_64 random(2);
  const PartChain chain = bent_tube();
  ScanOfTube how{kRadius_m, kStep_m};
  how.noise_m = 0.1 * kStep_m;
  expect_tube(tubes_of(mesh_of_tube(chain, how, random)), chain, kStep_m, 0.1);
}

TEST(ScanTubes, PartialMeshIsFoundWithinAFifthOfAVoxel) {
  std::mt19937_64 random(3);
  const PartChain chain = lying_tube();
  ScanOfTube how{kRadius_m, kStep_m};
  how.section_rad = 0.8 * kPi;
  how.noise_m = 0.05 * kStep_m;
  expect_tube(tubes_of(mesh_of_tube(chain, how, random)), chain, kStep_m, 0.2);
}

TEST(ScanTubes, DigitalObjectIsFoundWithinThreeTenthsOfAVoxel) {
  const PartChain chain = bent_tube();
  const TubeFrame frame = tubes_of(voxels_of_tube(chain, {4.9 * kStep_m, kStep_m}));
  ASSERT_EQ(frame.tubes.size(), 1U);
  const LineError error = error_of(frame.tubes.front().centerline_m, chain);
  std::printf("  rms %.4f, max %.4f voxels, radius %.3f voxels, sigma %.4f\n", error.rms_m / kStep_m,
              error.max_m / kStep_m, frame.tubes.front().radius_m / kStep_m, frame.tubes.front().sigma_m[20] / kStep_m);
  EXPECT_LE(error.rms_m, 0.3 * kStep_m);
  EXPECT_NEAR(frame.tubes.front().radius_m, 4.9 * kStep_m, 0.2 * kStep_m);
}

TEST(ScanTubes, HeightMapIsFoundWithinThreeTenthsOfAVoxel) {
  const PartChain chain = lying_tube();
  const Scan scan = heights_of_tube(chain, {8.0 * kStep_m, kStep_m});
  const TubeFrame frame = tubes_of(scan);
  ASSERT_EQ(frame.tubes.size(), 1U);
  const LineError error = error_of(frame.tubes.front().centerline_m, chain);
  std::printf("  rms %.4f, max %.4f voxels, radius %.3f voxels, sigma %.4f\n", error.rms_m / kStep_m,
              error.max_m / kStep_m, frame.tubes.front().radius_m / kStep_m, frame.tubes.front().sigma_m[20] / kStep_m);
  EXPECT_LE(error.rms_m, 0.3 * kStep_m);
  EXPECT_NEAR(frame.tubes.front().radius_m, 8.0 * kStep_m, 0.2 * kStep_m);
}

TEST(ScanTubes, ARingIsOneClosedTubeWithoutEnds) {
  PartChain ring;
  ring.direction = Eigen::Vector3d::UnitX();
  ring.towards = Eigen::Vector3d::UnitY();
  ring.bends = {{0.0, 0.0, 2.0 * kPi, 0.05, true}};
  std::mt19937_64 random(4);
  ScanOfTube how{kRadius_m, kStep_m};
  how.closed = true;
  const TubeFrame frame = tubes_of(mesh_of_tube(ring, how, random));
  ASSERT_EQ(frame.tubes.size(), 1U);
  const Tube& tube = frame.tubes.front();
  EXPECT_TRUE(tube.closed);
  EXPECT_EQ(tube.centerline_m.front(), tube.centerline_m.back());
  EXPECT_NEAR(tube.length_m, 2.0 * kPi * 0.05, 0.003 * 2.0 * kPi * 0.05);
  const LineError error = error_of(tube.centerline_m, ring);
  std::printf("  rms %.4f voxels, radius %.4f\n", error.rms_m / kStep_m, tube.radius_m / kStep_m);
  EXPECT_LE(error.rms_m, 0.1 * kStep_m);
}

TEST(ScanTubes, TheLengthIsTheSameWhereverTheTubeLies) {
  constexpr double kRing_m = 0.002;
  PartChain chain;
  chain.direction = Eigen::Vector3d::UnitX();
  chain.towards = Eigen::Vector3d::UnitY();
  chain.closing_m = 0.2;
  for (double shift_m = -0.5 * kRing_m; shift_m <= 2.0 * kRing_m; shift_m += 0.25 * kRing_m) {
    std::mt19937_64 random(7);
    chain.start_m = {shift_m, 0.0, 0.0};
    const TubeFrame frame = tubes_of(mesh_of_tube(chain, {0.01, kRing_m}, random));
    ASSERT_EQ(frame.tubes.size(), 1U);
    EXPECT_NEAR(frame.tubes.front().length_m, chain.closing_m, 0.1 * kRing_m) << "shifted by " << shift_m << " m";
  }
}

/// Both walls of a pipe, whose surface turns its back on the wall's material.
Scan mesh_of_pipe(const PartChain& chain, double radius_m, double wall_m, double step_m) {
  std::mt19937_64 random(8);
  Scan pipe = mesh_of_tube(chain, {radius_m, step_m}, random);
  const Scan inside = mesh_of_tube(chain, {radius_m - wall_m, step_m}, random);
  const auto first = static_cast<std::uint32_t>(pipe.points_m.size());
  pipe.points_m.insert(pipe.points_m.end(), inside.points_m.begin(), inside.points_m.end());
  for (const auto& face : inside.faces) pipe.faces.push_back({first + face[0], first + face[2], first + face[1]});
  return pipe;
}

TEST(ScanTubes, APipeHasTheRadiusOfItsOuterWallHoweverThinTheWall) {
  PartChain chain;
  chain.direction = Eigen::Vector3d::UnitX();
  chain.towards = Eigen::Vector3d::UnitY();
  chain.closing_m = 0.2;
  for (const double wall_m : {0.0005, 0.001, 0.002, 0.003, 0.004}) {
    const TubeFrame frame = tubes_of(mesh_of_pipe(chain, 0.01, wall_m, 0.002));
    ASSERT_EQ(frame.tubes.size(), 1U) << "wall of " << wall_m << " m";
    EXPECT_NEAR(frame.tubes.front().radius_m, 0.01, 0.00001) << "wall of " << wall_m << " m";
  }
}

TEST(ScanTubes, AKnownRadiusIsHeld) {
  std::mt19937_64 random(5);
  const PartChain chain = bent_tube();
  ScanTubesConfig config;
  config.radius_m = kRadius_m;
  const TubeFrame frame = tubes_of(mesh_of_tube(chain, {kRadius_m, kStep_m}, random), config);
  expect_tube(frame, chain, kStep_m, 0.1);
  EXPECT_EQ(frame.tubes.front().radius_m, kRadius_m);
}

TEST(ScanTubes, AFineMeshIsFoundWithinATenthOfAVoxel) {
  std::mt19937_64 random(6);
  const PartChain chain = bent_tube();
  const Scan scan = mesh_of_tube(chain, {kRadius_m, 0.4 * kStep_m}, random);
  std::printf("  %zu faces\n", scan.faces.size());
  expect_tube(tubes_of(scan), chain, 0.4 * kStep_m, 0.1);
}

TEST(ScanTubes, SameScanGivesTheSameBytes) {
  std::mt19937_64 random(7);
  const Scan scan = mesh_of_tube(bent_tube(), {kRadius_m, 2.0 * kStep_m}, random);
  const TubeFrame a = tubes_of(scan), b = tubes_of(scan);
  ASSERT_EQ(a.tubes.size(), b.tubes.size());
  for (std::size_t i = 0; i < a.tubes.size(); ++i) EXPECT_EQ(a.tubes[i].centerline_m, b.tubes[i].centerline_m);
}

/// Voxels within the radius of any of the lines from a point.
Scan voxels_of_star(const std::vector<Eigen::Vector3d>& ends_m, double radius_m, double step_m) {
  Scan scan;
  scan.kind = ScanKind::voxels;
  scan.grid_step_m = step_m;
  VoxelGrid& grid = scan.voxels;
  Eigen::AlignedBox3d box(Eigen::Vector3d::Zero());
  for (const Eigen::Vector3d& end_m : ends_m) box.extend(end_m);
  grid.origin_m = box.min() - Eigen::Vector3d::Constant(radius_m + 3.0 * step_m);
  grid.axes_m = step_m * Eigen::Matrix3d::Identity();
  grid.size = ((box.diagonal().array() + 2.0 * radius_m) / step_m + 6.0).ceil().cast<int>();
  grid.inside.assign(static_cast<std::size_t>(grid.size.prod()), 0);
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      for (int i = 0; i < grid.size.x(); ++i) {
        const Eigen::Vector3d at_m = grid.origin_m + step_m * Eigen::Vector3d(i, j, k);
        for (const Eigen::Vector3d& end_m : ends_m) {
          const double share = std::clamp(at_m.dot(end_m) / end_m.squaredNorm(), 0.0, 1.0);
          if ((at_m - share * end_m).norm() < radius_m) grid.inside[grid.at(i, j, k)] = 1;
        }
      }
    }
  }
  return scan;
}

TEST(ScanTubes, AYIsThreeTubesOrTwoThatMeetAtOneJoint) {
  const std::vector<Eigen::Vector3d> ends_m{{0.0, -0.09, 0.0}, {0.05, 0.08, 0.01}, {-0.06, 0.075, -0.01}};
  const TubeFrame frame = tubes_of(voxels_of_star(ends_m, kRadius_m, kStep_m));
  ASSERT_GE(frame.tubes.size(), 2U);
  ASSERT_LE(frame.tubes.size(), 3U);
  const std::vector<TubeJoint> joints = joints_of(frame.tubes);
  ASSERT_EQ(joints.size(), 1U);
  const TubeJoint& joint = joints.front();
  EXPECT_EQ(joint.parts.size(), frame.tubes.size());
  EXPECT_LE(joint.position_m.norm(), 1.5 * kRadius_m);
  // No tube turns from one arm into another and back: its line stays in the arms.
  for (const Tube& tube : frame.tubes) {
    for (const Eigen::Vector3d& node_m : tube.centerline_m) {
      double least_m = 1.0;
      for (const Eigen::Vector3d& end_m : ends_m)
        least_m = std::min(least_m, distance_from({Eigen::Vector3d::Zero(), end_m}, node_m));
      EXPECT_LE(least_m, 1.2 * kRadius_m);
    }
  }
}

TEST(ScanTubes, WhatIsNoTubeIsNone) {
  // A plate, and a box edge.
  std::vector<ScanSurfel> surfels;
  for (int i = 0; i < 100; ++i) {
    for (int k = 0; k < 100; ++k) {
      ScanSurfel flat;
      flat.position_m = {0.001F * static_cast<float>(i), 0.001F * static_cast<float>(k), 0.0F};
      flat.inward_normal = -Eigen::Vector3f::UnitZ();
      surfels.push_back(flat);
      flat.position_m = {0.001F * static_cast<float>(i), 0.0F, -0.001F * static_cast<float>(k)};
      flat.inward_normal = Eigen::Vector3f::UnitY();
      surfels.push_back(flat);
    }
  }
  ScanTubesConfig config;
  config.grid_step_m = 0.001;
  const TubeFrame frame = find_scan_tubes(surfels, config);
  EXPECT_EQ(frame.tubes.size(), 0U);
  EXPECT_EQ(frame.status, TrackStatus::empty);
  EXPECT_EQ(find_scan_tubes({}, config).tubes.size(), 0U);
}

TEST(ScanTubes, ConfigurationIsCheckedByName) {
  ScanTubesConfig config;
  EXPECT_THAT(validate(config).error().message, HasSubstr("grid_step_m: 0, takes"));
  config.grid_step_m = 0.001;
  EXPECT_TRUE(validate(config));
  config.radius_min_m = 0.2;
  EXPECT_THAT(validate(config).error().message, HasSubstr("radius_max_m: 0.1, takes metres, above radius_min_m"));
}

TEST(ScanTubes, TheSameBytesWithEveryVectorLength) {
  const Scan scan = voxels_of_tube(lying_tube(), {4.9 * kStep_m, kStep_m});
  const TubeFrame best = tubes_of(scan);
  ASSERT_EQ(best.tubes.size(), 1U);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    const TubeFrame frame = tubes_of(scan);
    ASSERT_EQ(frame.tubes.size(), 1U) << hwy::TargetName(target);
    EXPECT_EQ(frame.tubes[0].centerline_m, best.tubes[0].centerline_m) << hwy::TargetName(target);
    EXPECT_EQ(frame.tubes[0].radius_m, best.tubes[0].radius_m) << hwy::TargetName(target);
    EXPECT_EQ(frame.tubes[0].sigma_m, best.tubes[0].sigma_m) << hwy::TargetName(target);
  }
  hwy::SetSupportedTargetsForTest(0);
}

}  // namespace
}  // namespace tubetrack
