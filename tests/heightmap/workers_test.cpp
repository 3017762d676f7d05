#include "tubetrack/heightmap/workers.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <thread>

#include "heightmap/surfel_stream.hpp"
#include "tubetrack/heightmap/normals.hpp"

namespace tubetrack {
namespace {

TEST(Workers, EachShareIsDoneOnceOnAThreadOfItsOwnAndSeenByTheCaller) {
  for (const int count : {1, 2, 5}) {
    Workers workers(count);
    ASSERT_EQ(workers.count(), count);
    std::vector<int> done(static_cast<std::size_t>(count), 0);
    std::vector<std::thread::id> ids(done.size());
    for (int round = 1; round <= 500; ++round) {
      workers.run([&](int i) {
        ++done[static_cast<std::size_t>(i)];
        ids[static_cast<std::size_t>(i)] = std::this_thread::get_id();
      });
      ASSERT_EQ(done, std::vector<int>(done.size(), round));
    }
    EXPECT_EQ(ids[0], std::this_thread::get_id());
    EXPECT_EQ(std::set<std::thread::id>(ids.begin(), ids.end()).size(), ids.size());
  }
}

TEST(Workers, EndWithoutHavingBeenAskedForAnything) {
  for (int i = 0; i < 50; ++i) const Workers workers(4);
}

TEST(Workers, PartsOfARangeFollowOnEachOther) {
  for (const int size : {0, 1, 3, 30, 480}) {
    int end = 0;
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(part_of(size, i, 4).begin, end);
      end = part_of(size, i, 4).end;
    }
    EXPECT_EQ(end, size);
  }
}

// Half of the frames are new altogether, the others change in places.
TEST(Workers, AnyNumberOfThemMakesTheSameMapAndTheSameSurfels) {
  constexpr int kFrames = 6;
  std::vector<float> heights;
  std::vector<Surfel> surfels;
  for (const int count : {1, 2, 3, 4, 16}) {
    Workers workers(count);
    Stream stream;
    stream.hole_share = 0.02;
    HeightMap map = make_height_map(kStreamCamera);
    SurfelFinder finder;
    std::vector<Surfel> all;
    for (int frame = 0; frame < kFrames; ++frame) {
      stream.shift_m.x() = 0.01 * frame;
      update(map, stream.next(), {}, {}, frame % 2 == 1, workers);
      const auto found = finder.find(map, {}, {}, {}, workers);
      all.insert(all.end(), found.begin(), found.end());
    }
    if (count == 1) {
      heights = map.inverse_depth_per_m;
      surfels = all;
      EXPECT_GT(surfels.size(), 5000U);
    }
    EXPECT_EQ(map.inverse_depth_per_m, heights) << count;
    ASSERT_EQ(all.size(), surfels.size()) << count;
    EXPECT_EQ(std::memcmp(all.data(), surfels.data(), all.size() * sizeof(Surfel)), 0) << count;
  }
}

}  // namespace
}  // namespace tubetrack
