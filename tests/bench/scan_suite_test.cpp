// The benchmark of bends in static scans: that it measures what it says, and a few of its tubes.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "bend_study.hpp"
#include "figures.hpp"
#include "holed_tube.hpp"
#include "paper_table.hpp"
#include "random_tubes.hpp"
#include "thinning.hpp"
#include "tubetrack/tracker/bend_table.hpp"

namespace tubetrack::bench {
namespace {

constexpr double kDegree = M_PI / 180.0;

TEST(BendStudy, ATablesDeviationsAreTheSameFromEitherEnd) {
  PartChain truth;
  truth.bends = {{0.10, 0.0, 1.2, 0.030}, {0.06, 1.0, 0.8, 0.040}, {0.08, -2.0, 1.6, 0.024}};
  truth.closing_m = 0.09;
  FittedChain there{truth, RecycledVector<BendSigma>(3), 0.0};
  there.chain.bends[1].angle_rad += 0.01;
  FittedChain back = there;
  const auto& bends = there.chain.bends;
  back.chain.bends = {{0.09, 0.0, 1.6, 0.024}, {0.08, -2.0, bends[1].angle_rad, 0.040}, {0.06, 1.0, 1.2, 0.030}};
  back.chain.closing_m = 0.10;
  for (const FittedChain& fitted : {there, back}) {
    BendDeviations off;
    ASSERT_TRUE(add_deviations(truth, bend_table_of(fitted), off));
    ASSERT_EQ(off.angle.size(), 3U);
    EXPECT_NEAR(off.angle[1].error, 0.01, 1e-12);
    EXPECT_NEAR(off.angle[0].error, 0.0, 1e-12);
    ASSERT_EQ(off.rotation.size(), 2U);
    for (const Deviation& rotation : off.rotation) EXPECT_NEAR(rotation.error, 0.0, 1e-12);
    ASSERT_EQ(off.inner_length.size(), 2U);
    ASSERT_EQ(off.end_length.size(), 2U);
    for (const double excess : off.length_excess) EXPECT_NEAR(excess, 0.0, 1e-9);
  }
}

TEST(BendStudy, RandomTubesAreWhatTheyShouldBe) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const RandomTube tube = random_tube(seed);
    ASSERT_GE(tube.chain.bends.size(), 1U);
    ASSERT_LE(tube.chain.bends.size(), 6U);
    for (const ChainBend& bend : tube.chain.bends) {
      EXPECT_GE(bend.angle_rad, 30.0 * kDegree);
      EXPECT_LE(bend.angle_rad, 180.0 * kDegree);
      EXPECT_GE(bend.radius_m, 3.0 * tube.radius_m);
      EXPECT_LE(bend.radius_m, 20.0 * tube.radius_m);
      EXPECT_GE(bend.straight_m, 2.0 * tube.radius_m);
    }
    EXPECT_GE(tube.chain.closing_m, 2.0 * tube.radius_m);
  }
}

/// On tubes that docs/bends.md does not count.
void expect_goals(bool one_side) {
  constexpr std::uint64_t kFirstSeed = 10'001;
  constexpr int kTubes = 8;
  const double times = one_side ? 2.0 : 1.0;
  const BendStudy study = study_bends(kFirstSeed, kTubes, one_side);
  EXPECT_EQ(study.right, kTubes);
  for (const std::string& line : study.wrong) ADD_FAILURE() << line;
  const BendDeviations& off = study.deviations;
  // A tenth of the goals and less: docs/bends.md.
  EXPECT_LE(median_error(off.angle), times * 0.01 * kDegree);
  EXPECT_LE(quantile(off.radius_relative, 0.5), times * 0.0002);
  EXPECT_LE(median_error(off.rotation), times * 0.01 * kDegree);
  EXPECT_LE(quantile(off.length_excess, 0.5), times * 0.3);
  // Of some 25 bends, whose numbers err together; docs/bends.md has each by itself.
  std::vector<Deviation> all = off.angle;
  for (const auto* more : {&off.radius, &off.rotation, &off.inner_length, &off.end_length})
    all.insert(all.end(), more->begin(), more->end());
  EXPECT_GE(part_inside(all), 0.86);
}

TEST(BendStudy, BendsOfFullScansAreMeasured) {
  expect_goals(false);
}

TEST(BendStudy, BendsSeenFromOneSideAreMeasured) {
  expect_goals(true);
}

// Faces stand in patterns: told by every k-th of them the least radius was too large, and these tubes fell into pieces.
// pieces.
TEST(BendStudy, AMeshsLeastRadiusIsToldByAllOfItsFaces) {
  for (const std::uint64_t seed : {47, 72, 135}) {
    const BendStudy study = study_bends(seed, 1, false);
    EXPECT_EQ(study.right, 1) << "seed " << seed;
  }
}

TEST(PaperTable, SmallScansMeetTheGoalsOfLargeOnes) {
  constexpr double kTimes = 0.1;  // of the faces
  std::vector<PaperScan> scans = robustness_scans(kTimes);
  for (PaperScan& scan : paper_scans(kTimes)) {
    // Short as it is, the digital object is half ends, and those are rounded.
    if (scan.scan.kind == ScanKind::mesh) scans.push_back(std::move(scan));
  }
  for (const PaperScan& scan : scans) {
    const PaperRow row = measure(scan, false);
    EXPECT_EQ(row.tubes, 1U) << row.name;
    EXPECT_LE(row.rms_voxels, row.goal_voxels) << row.name;
    EXPECT_NEAR(row.found, 1.0, 0.02) << row.name;
  }
}

TEST(PaperTable, AScanOfSoManyFacesHasThem) {
  const PaperRow row = measure(mesh_of_faces(20'000), true);
  EXPECT_NEAR(static_cast<double>(row.faces), 20'000.0, 100.0);
  EXPECT_GT(row.transcription_s, 0.0);
  EXPECT_GT(row.ours_s, 0.0);
}

VoxelGrid box(int x, int y, int z) {
  VoxelGrid grid;
  grid.size = {x + 2, y + 2, z + 2};
  grid.inside.assign(static_cast<std::size_t>((x + 2) * (y + 2) * (z + 2)), 0);
  for (int k = 1; k <= z; ++k) {
    for (int j = 1; j <= y; ++j) {
      for (int i = 1; i <= x; ++i) grid.inside[grid.at(i, j, k)] = 1;
    }
  }
  return grid;
}

TEST(Thinning, ABarBecomesALineWithTwoEnds) {
  const Topology line = topology_of(thinned(box(20, 3, 3)));
  EXPECT_EQ(line.pieces, 1U);
  EXPECT_EQ(line.ends, 2U);
  EXPECT_EQ(line.loops, 0U);
  EXPECT_EQ(line.cavities, 0U);
  EXPECT_LE(line.voxels, 20U);
}

TEST(Thinning, TunnelsAndCavitiesStay) {
  VoxelGrid plate = box(9, 9, 3);
  for (int k = 1; k <= 3; ++k) {
    for (const int i : {3, 7}) plate.inside[plate.at(i, 5, k)] = 0;
  }
  VoxelGrid hollow = box(7, 7, 7);
  hollow.inside[hollow.at(4, 4, 4)] = 0;
  for (const VoxelGrid& body : {plate, hollow}) {
    const Topology whole = topology_of(body), left = topology_of(thinned(body));
    EXPECT_EQ(left.pieces, 1U);
    EXPECT_EQ(left.loops, whole.loops);
    EXPECT_EQ(left.cavities, whole.cavities);
    EXPECT_LT(left.voxels, whole.voxels);
  }
  EXPECT_EQ(topology_of(plate).loops, 2U);
  EXPECT_EQ(topology_of(hollow).cavities, 1U);
}

TEST(HoledTube, IsFollowedThroughItsHoles) {
  const PaperScan whole = holed_tube(0.0, 1.5), holed = holed_tube(0.05, 1.5);
  const auto count = [](const PaperScan& scan) {
    return std::accumulate(scan.scan.voxels.inside.begin(), scan.scan.voxels.inside.end(), 0.0);
  };
  EXPECT_NEAR(count(holed) / count(whole), 0.95, 0.002);
  const PaperRow row = measure(holed, false);
  EXPECT_LE(row.rms_voxels, 0.1);
  EXPECT_GE(row.found, 0.97);
}

}  // namespace
}  // namespace tubetrack::bench
