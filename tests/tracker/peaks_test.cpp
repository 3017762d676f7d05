// What the accumulation map remembers of its peaks is what a look at all of it finds.
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <utility>

#include "tracker/vote_records.hpp"

namespace tubetrack {
namespace {

// Some 30 records through 80³ voxels, of which a step changes one or two.
RC_GTEST_PROP(Peaks, AfterAnyStepsTheyAreThoseOfTheMapOfTheLiveRecords,
              (Records live, const Records& later, std::uint64_t seed)) {
  for (const VoteRecord& record : *rc::gen::container<Records>(20, rc::gen::arbitrary<VoteRecord>())) {
    live.push_back(record);
  }
  AccumulationMap map = map_of(live);
  RC_ASSERT(map.peaks(2, 1) == map_of(live).peaks(2, 1));
  std::mt19937_64 random(seed);
  for (const VoteRecord& record : later) {
    if (random() % 2 == 0) {
      map.add(record);
      live.push_back(record);
    } else if (!live.empty()) {
      std::swap(live[random() % live.size()], live.back());
      map.withdraw(live.back());
      live.pop_back();
    }
    if (random() % 20 == 0) {
      map.clear();
      live.clear();
    }
    RC_ASSERT(map.peaks(2, 1) == map_of(live).peaks(2, 1));
  }
}

RC_GTEST_PROP(Peaks, OfOtherVotesOrAnotherBoxAreLookedForAnew, (const Records& records)) {
  AccumulationMap map = map_of(records);
  for (const auto& [votes, half] : {std::pair{1, 1}, {3, 1}, {3, 0}, {3, 2}, {1, 4}, {1, 4}, {1, 1}}) {
    RC_ASSERT(map.peaks(votes, half) == map_of(records).peaks(votes, half));
  }
}

RC_GTEST_PROP(Peaks, RememberTheVotesOfTheirBoxAndItsSpreadWhileTheyStay,
              (const Records& records, const Records& later)) {
  AccumulationMap map = map_of(records);
  const auto check = [&] {
    const std::vector<VoxelIndex>& peaks = map.peaks(2, 1);
    for (std::size_t i = 0; i < peaks.size(); ++i) {
      RC_ASSERT(map.peak_votes(i) == map.box_votes(peaks[i], 1));
      // Asked twice, the second time from memory.
      for (int k = 0; k < 2; ++k) RC_ASSERT(map.peak_spread(i) == axis_of(map.box(peaks[i], 1)).spread);
    }
  };
  check();
  for (const VoteRecord& record : later) {
    map.add(record);
    check();
  }
}

RC_GTEST_PROP(BlockTable, FindsWhatWasInsertedAndNotErased, (const std::vector<std::tuple<int, int, int>>& keys)) {
  BlockTable table;
  std::map<VoxelIndex, std::int32_t> expected;
  std::int32_t next = 0;
  // Few places, so that most come again and are erased then.
  for (const auto& [z, y, x] : keys) {
    for (const VoxelIndex key : {VoxelIndex{z % 3, y % 3, x % 3}, {z, y, x}}) {
      if (expected.erase(key) != 0) {
        table.erase(key);
      } else {
        table.insert(key, next);
        expected[key] = next++;
      }
    }
    RC_ASSERT(table.size() == expected.size());
    for (int i = 0; i < 125; ++i) {
      const VoxelIndex key{i / 25 - 2, i / 5 % 5 - 2, i % 5 - 2};
      const auto found = expected.find(key);
      RC_ASSERT(table.find(key) == (found == expected.end() ? BlockTable::kNone : found->second));
    }
  }
  for (const auto& [key, block] : expected) RC_ASSERT(table.find(key) == block);
}

TEST(BlockTable, GrowsAndKeepsWhatIsLeftOfManyBlocks) {
  BlockTable table;
  for (int i = 0; i < 20000; ++i) table.insert({i / 400, i / 20 % 20, i % 20}, i);
  for (int i = 0; i < 20000; i += 3) table.erase({i / 400, i / 20 % 20, i % 20});
  for (int i = 0; i < 20000; ++i) {
    ASSERT_EQ(table.find({i / 400, i / 20 % 20, i % 20}), i % 3 == 0 ? BlockTable::kNone : i);
  }
  table.clear();
  EXPECT_EQ(table.size(), 0U);
  EXPECT_EQ(table.find({0, 0, 1}), BlockTable::kNone);
}

}  // namespace
}  // namespace tubetrack
