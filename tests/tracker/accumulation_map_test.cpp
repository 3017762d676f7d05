#include "tubetrack/tracker/accumulation_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "tracker/vote_records.hpp"

namespace tubetrack {

namespace {

using Eigen::Vector3d;
using DenseMap = std::map<VoxelIndex, Voxel>;

std::int64_t floor_divide(std::int64_t a, std::int64_t b) {
  return a / b - (a % b != 0 && (a < 0) != (b < 0) ? 1 : 0);
}

/// What a record votes, by its definition.
void vote(DenseMap& map, const VoteRecord& record) {
  std::set<VoxelIndex> visited;
  std::array<std::int64_t, 3> d{};
  for (std::size_t i = 0; i < 3; ++i) d[i] = static_cast<std::int64_t>(std::floor(record.direction[i] / 32.0 + 0.5));
  for (int step = record.first_step; step <= record.last_step; ++step) {
    const auto at = [&](std::size_t i) {
      return static_cast<int>(floor_divide(record.origin[i] + std::int64_t{step} * record.direction[i], 4096));
    };
    const VoxelIndex index{at(2), at(1), at(0)};
    if (!visited.insert(index).second) continue;
    Voxel& voxel = map[index];
    voxel.votes += record.weight;
    voxel.steps += record.weight * step;
    const std::array<std::int64_t, 6> products{d[0] * d[0], d[0] * d[1], d[0] * d[2],
                                               d[1] * d[1], d[1] * d[2], d[2] * d[2]};
    for (std::size_t i = 0; i < 6; ++i) voxel.moments[i] += record.weight * products[i];
  }
}

DenseMap dense(const Records& records) {
  DenseMap map;
  for (const VoteRecord& record : records) vote(map, record);
  return map;
}

Voxel value_at(const DenseMap& map, const VoxelIndex& index) {
  const auto found = map.find(index);
  return found == map.end() ? Voxel{} : found->second;
}

std::set<VoxelIndex> around(const DenseMap& map, int half) {
  std::set<VoxelIndex> result;
  for (const auto& [at, voxel] : map) {
    for (int z = -half; z <= half; ++z) {
      for (int y = -half; y <= half; ++y) {
        for (int x = -half; x <= half; ++x) result.insert({at.z + z, at.y + y, at.x + x});
      }
    }
  }
  return result;
}

Voxel box_of(const DenseMap& map, const VoxelIndex& center, int half) {
  Voxel sum;
  for (int z = -half; z <= half; ++z) {
    for (int y = -half; y <= half; ++y) {
      for (int x = -half; x <= half; ++x) sum += value_at(map, {center.z + z, center.y + y, center.x + x});
    }
  }
  return sum;
}

RC_GTEST_PROP(AccumulationMap, ARecordVotesOnceInEveryVoxelOfItsSteps, (const Records& records)) {
  const AccumulationMap map = map_of(records);
  const DenseMap expected = dense(records);
  for (const VoxelIndex& at : around(expected, 1)) RC_ASSERT(map.at(at) == value_at(expected, at));
}

RC_GTEST_PROP(AccumulationMap, AnyOrderOfVotesAndWithdrawalsGivesTheMapOfTheLiveRecords,
              (const Records& live, const Records& gone, std::uint64_t seed)) {
  std::vector<std::pair<VoteRecord, bool>> steps;  // the record, and whether it is withdrawn
  for (const VoteRecord& record : live) steps.emplace_back(record, false);
  for (const VoteRecord& record : gone) {
    steps.emplace_back(record, false);
    steps.emplace_back(record, true);
  }
  std::mt19937_64 random(seed);
  std::shuffle(steps.begin(), steps.end(), random);
  AccumulationMap map(0.003);
  for (const auto& [record, withdrawn] : steps) withdrawn ? map.withdraw(record) : map.add(record);
  AccumulationMap batch = map_of(live);
  Records all = live;
  all.insert(all.end(), gone.begin(), gone.end());
  for (const auto& [at, voxel] : dense(all)) RC_ASSERT(map.at(at) == batch.at(at));
  RC_ASSERT(map.peaks(1, 0) == batch.peaks(1, 0));
  RC_ASSERT(map.peaks(3, 1) == batch.peaks(3, 1));
}

RC_GTEST_PROP(AccumulationMap, WithdrawingEverythingLeavesZero, (const Records& records)) {
  AccumulationMap map = map_of(records);
  for (const VoteRecord& record : records) map.withdraw(record);
  for (const auto& [at, voxel] : dense(records)) RC_ASSERT(map.at(at) == Voxel{});
  RC_ASSERT(map.peaks(1, 0).empty());
}

RC_GTEST_PROP(AccumulationMap, ABoxIsTheSumOfItsVoxels, (const Records& records)) {
  const AccumulationMap map = map_of(records);
  const DenseMap expected = dense(records);
  for (const auto& [at, voxel] : expected) {
    for (const int half : {0, 1, 2}) {
      RC_ASSERT(map.box(at, half) == box_of(expected, at, half));
      RC_ASSERT(map.box_votes(at, half) == box_of(expected, at, half).votes);
    }
  }
}

/// Peaks by looking at every voxel.
std::vector<VoxelIndex> peaks_by_force(const DenseMap& map, int min_votes, int half) {
  const int own = std::max(1, min_votes / 6);
  std::map<VoxelIndex, int> sums;
  for (const auto& [at, voxel] : map) {
    const int sum = box_of(map, at, half).votes;
    if (voxel.votes >= own && sum >= min_votes) sums[at] = sum;
  }
  std::vector<VoxelIndex> peaks;
  for (const auto& [at, sum] : sums) {
    bool best = true;
    for (const auto& [other, other_sum] : sums) {
      const bool beside =
          std::abs(other.x - at.x) <= 1 && std::abs(other.y - at.y) <= 1 && std::abs(other.z - at.z) <= 1;
      if (beside && (other_sum > sum || (other_sum == sum && other < at))) best = false;
    }
    if (best) peaks.push_back(at);
  }
  std::stable_sort(peaks.begin(), peaks.end(),
                   [&](const VoxelIndex& a, const VoxelIndex& b) { return sums[a] > sums[b]; });
  return peaks;
}

// Rays through a few voxels only, so that there are crossings and many ties.
RC_GTEST_PROP(AccumulationMap, PeaksAreTheLocalMaximaTiesToTheLowestVoxel, (Records records)) {
  if (records.size() > 25) records.resize(25);
  for (VoteRecord& record : records) {
    for (std::int32_t& place : record.origin) place /= 16;
    record.last_step = std::min<std::int16_t>(record.last_step, 12);
  }
  AccumulationMap map = map_of(records);
  const DenseMap expected = dense(records);
  for (const int half : {0, 1, 2}) {
    for (const int min_votes : {1, 3, 30}) {
      RC_ASSERT(map.peaks(min_votes, half) == peaks_by_force(expected, min_votes, half));
    }
  }
}

TEST(AccumulationMap, OfTwoEqualNeighboursTheLowerIsThePeak) {
  AccumulationMap map(0.001);
  for (const int x : {5, 4, 6}) {
    map.add({{x * 4096 + 2048, 2048, 2048}, {0, 0, 4096}, 0, 0, 2});
  }
  EXPECT_THAT(map.peaks(1, 0), ::testing::ElementsAre(VoxelIndex{0, 0, 4}));
}

TEST(AccumulationMap, VoxelsOfNegativeCoordinatesAreFoundByTheirCentre) {
  const AccumulationMap map(0.004);
  for (const VoxelIndex index : {VoxelIndex{0, 0, 0}, {-1, -8, -9}, {300, -1, 7}}) {
    EXPECT_EQ(map.index_of(map.center_of(index)), index);
  }
  EXPECT_EQ(map.index_of({-1e-6, 0.0, 0.0041}), (VoxelIndex{1, 0, -1}));
}

TEST(AccumulationMap, ASurfelsRecordRunsThroughItsBandOfRadii) {
  Surfel surfel;
  surfel.position_m = {0.1F, -0.2F, 0.8F};
  surfel.inward_normal = {0.6F, 0.0F, 0.8F};
  surfel.radius_min_m = 0.010F;
  surfel.radius_max_m = 0.0212F;
  const VoteRecord record = vote_record(surfel, 0.002);
  EXPECT_EQ(record.first_step, 5);
  EXPECT_EQ(record.last_step, 11);  // 10.6, to the nearest
  EXPECT_THAT(record.origin, ::testing::ElementsAre(204800, -409600, 1638400));
  EXPECT_THAT(record.direction, ::testing::ElementsAre(2458, 0, 3277));
}

TEST(AccumulationMap, ASurfelBeyondTheGridVotesNowhere) {
  Surfel surfel;
  surfel.radius_max_m = 0.02F;
  surfel.position_m = {0.0F, 0.0F, 60.0F};  // 600 000 voxels
  EXPECT_LT(vote_record(surfel, 1e-4).last_step, vote_record(surfel, 1e-4).first_step);
  surfel.position_m = {0.0F, 0.0F, 1.0F};
  surfel.radius_max_m = 4.0F;  // 40 000 steps
  EXPECT_LT(vote_record(surfel, 1e-4).last_step, vote_record(surfel, 1e-4).first_step);
  surfel.position_m.x() = std::nanf("");
  surfel.radius_max_m = 0.02F;
  EXPECT_LT(vote_record(surfel, 1e-3).last_step, vote_record(surfel, 1e-3).first_step);
}

// A ball that fills the view sends more than 131 072 votes into one box.
TEST(AccumulationMap, MomentsHoldTheVotesOfAWholeImage) {
  AccumulationMap map(0.001);
  map.add({{0, 0, 0}, {0, 0, 4096}, 0, 0, 1'000'000});
  EXPECT_EQ(map.at({0, 0, 0}).moments[5], 1'000'000LL * 128 * 128);
  EXPECT_EQ(map.box({0, 0, 0}, 1).moments[5], 1'000'000LL * 128 * 128);
}

TEST(AccumulationMap, MomentsBeyond32BitsAreExactAndGoAwayWithTheirVotes) {
  AccumulationMap map(0.001);
  const VoteRecord along{{0, 0, 0}, {0, 0, 4096}, 0, 0, 60'000}, askew{{0, 0, 0}, {2896, 0, -2896}, 0, 0, 60'000};
  for (int i = 0; i < 100; ++i) {
    map.add(along);
    map.add(askew);
  }
  constexpr std::int64_t kVotes = 6'000'000, kAskew = 2896 / 32 + 1;  // 90.5, to the nearest
  const Voxel full = map.at({0, 0, 0});
  EXPECT_EQ(full.votes, 2 * kVotes);
  EXPECT_EQ(full.moments[0], kVotes * kAskew * kAskew);
  EXPECT_EQ(full.moments[2], -kVotes * kAskew * (kAskew - 1));
  EXPECT_EQ(full.moments[5], kVotes * (128 * 128 + (kAskew - 1) * (kAskew - 1)));
  EXPECT_EQ(map.box({0, 0, 0}, 1), full);
  for (int i = 0; i < 100; ++i) map.withdraw(askew);
  EXPECT_EQ(map.at({0, 0, 0}), (Voxel{kVotes, 0, {0, 0, 0, 0, 0, kVotes * 128 * 128}}));
  for (int i = 0; i < 100; ++i) map.withdraw(along);
  EXPECT_EQ(map.at({0, 0, 0}), Voxel{});
  EXPECT_EQ(map.block_count(), 0U);
  // Its place serves another voxel, and has forgotten.
  map.add({{8192, 0, 0}, {4096, 0, 0}, 0, 0, 1});
  EXPECT_EQ(map.at({0, 0, 2}), (Voxel{1, 0, {128 * 128, 0, 0, 0, 0, 0}}));
}

/// The voxel that rays from all places of an arc around `axis` cross, −half … half from `middle`.
Voxel voxel_of_arc(const Vector3d& axis, const Vector3d& middle, double half_rad) {
  AccumulationMap map(0.001);
  constexpr int kRays = 181;
  for (int i = 0; i < kRays; ++i) {
    const double angle = half_rad * (2.0 * i / (kRays - 1) - 1.0);
    Surfel surfel;
    const Vector3d inward = Eigen::AngleAxisd(angle, axis) * middle;
    surfel.inward_normal = inward.cast<float>();
    surfel.position_m = (Vector3d(0.0005, 0.0005, 0.0005) - 0.02 * inward).cast<float>();
    surfel.radius_max_m = 0.021F;
    map.add(vote_record(surfel, map.cell_m()));
  }
  return map.at({0, 0, 0});
}

TEST(VoxelAxis, OfATubeSeenFromOneSideIsNotTilted) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> gauss;
  double sum_deg = 0.0;
  constexpr int kPoses = 200;
  for (int i = 0; i < kPoses; ++i) {
    const Vector3d axis = Vector3d(gauss(random), gauss(random), gauss(random)).normalized();
    const VoxelAxis found = axis_of(voxel_of_arc(axis, axis.unitOrthogonal(), std::numbers::pi / 3.0));
    const double off = std::atan2(found.direction.cross(axis).norm(), std::abs(found.direction.dot(axis)));
    sum_deg += off * 180.0 / std::numbers::pi / kPoses;
    EXPECT_LT(off, 0.2 * std::numbers::pi / 180.0);
    EXPECT_LT(found.planar, 1e-3);
    Eigen::Index largest = 0;
    found.direction.cwiseAbs().maxCoeff(&largest);
    EXPECT_GT(found.direction[largest], 0.0);
  }
  EXPECT_LT(sum_deg, 0.05);
}

TEST(VoxelAxis, SpreadGrowsFromParallelVotesToVotesFromAllAround) {
  const Vector3d axis = Vector3d(1.0, 2.0, -0.5).normalized();
  EXPECT_NEAR(axis_of(voxel_of_arc(axis, axis.unitOrthogonal(), 1e-6)).spread, 0.0, 1e-3);
  // Over an arc of ±a: ½ − sin 2a / 4a.
  EXPECT_NEAR(axis_of(voxel_of_arc(axis, axis.unitOrthogonal(), 1.0)).spread, 0.5 - std::sin(2.0) / 4.0, 0.01);
  EXPECT_NEAR(axis_of(voxel_of_arc(axis, axis.unitOrthogonal(), std::numbers::pi)).spread, 0.5, 0.01);
  EXPECT_EQ(axis_of(Voxel{}).spread, 0.0);
}

}  // namespace
}  // namespace tubetrack
