// The accuracy suite's scenes are what its rows say.
#include "suite.hpp"

#include <gtest/gtest.h>

#include <string>

#include "scene_parts.hpp"

namespace tubetrack::bench {
namespace {

class EveryRow : public ::testing::TestWithParam<Row> {};

TEST_P(EveryRow, HasTheSameSceneForASeedAndAnotherForTheNext) {
  const Row& row = GetParam();
  for (const std::uint64_t seed : {1U, 2U, 1000001U}) {
    const Scene first = make_scene(row, seed).scene;
    const Scene again = make_scene(row, seed).scene;
    const Scene next = make_scene(row, seed + 1).scene;
    ASSERT_EQ(first.tubes.size(), again.tubes.size());
    EXPECT_EQ(first.solids.size(), again.solids.size());
    EXPECT_EQ(first.tubes.empty(), !row.holds_tubes);
    for (std::size_t i = 0; i < first.tubes.size(); ++i) EXPECT_EQ(first.tubes[i].start_m, again.tubes[i].start_m);
    if (row.holds_tubes) {
      EXPECT_NE(first.tubes[0].start_m, next.tubes[0].start_m);
    }
  }
}

TEST_P(EveryRow, TubesAreApart) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Scene scene = make_scene(GetParam(), seed).scene;
    for (std::size_t i = 0; i < scene.tubes.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) EXPECT_GT(gap_m(scene.tubes[i], scene.tubes[j]), -1e-4) << seed;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Suite, EveryRow, ::testing::ValuesIn(rows().begin(), rows().end()), [](const auto& row) {
  std::string name(row.param.name);
  std::erase(name, '-');
  return name;
});

}  // namespace
}  // namespace tubetrack::bench
