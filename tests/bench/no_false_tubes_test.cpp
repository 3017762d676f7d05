// What moves in front of the camera and is round for some frames is no tube. The scenes are those of the accuracy
// suite in which a finger or a forearm once was one.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "run.hpp"

namespace tubetrack::bench {
namespace {

struct Sequence {
  std::string_view row;
  std::uint64_t scene;  ///< of `accuracy_suite --row … --count 0 --sequences 1 --first …`
  bool holds_tubes;
};

class NoFalseTubes : public ::testing::TestWithParam<Sequence> {};

TEST_P(NoFalseTubes, AreReportedInAnyFrameBesideAMovingHand) {
  RunOptions options;
  options.first_seed = 1 + GetParam().scene;
  options.single_scenes = 0;
  options.sequences = 1;
  for (const Row& row : rows()) {
    if (row.name != GetParam().row) continue;
    const Figures figures = run_row(row, {tubetrack_method()}, options, [] {}).front().sequence;
    EXPECT_EQ(figures.frames, row.frames);
    EXPECT_EQ(figures.reported_tubes > 0, GetParam().holds_tubes);
    if (GetParam().holds_tubes) {
      EXPECT_EQ(figures.score.false_length(), 0.0);
    }
    return;
  }
  FAIL() << "no row " << GetParam().row;
}

INSTANTIATE_TEST_SUITE_P(Suite, NoFalseTubes,
                         ::testing::Values(Sequence{"clutter", 4, false}, Sequence{"hand", 10, true},
                                           Sequence{"hand", 13, true}, Sequence{"hand", 22, true}),
                         [](const auto& sequence) {
                           return std::string(sequence.param.row) + std::to_string(sequence.param.scene);
                         });

}  // namespace
}  // namespace tubetrack::bench
