#include "tubetrack/tracker/recast.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tubetrack {
namespace {

/// A stream of surfels in a space of half a metre: cells come, go, stay as they are or change altogether.
struct SurfelStream {
  std::mt19937_64 random{17};
  std::vector<Surfel> by_cell = std::vector<Surfel>(600);
  std::vector<bool> alive = std::vector<bool>(600, false);

  float uniform(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random); }

  std::vector<Surfel> next() {
    const float share = uniform(0.0F, 1.0F) < 0.1F ? 1.0F : uniform(0.0F, 0.2F);
    std::vector<Surfel> surfels;
    for (std::uint32_t cell = 0; cell < by_cell.size(); ++cell) {
      if (uniform(0.0F, 1.0F) < share) change(cell);
      if (alive[cell]) surfels.push_back(by_cell[cell]);
    }
    return surfels;
  }
  void change(std::uint32_t cell) {
    Surfel& surfel = by_cell[cell];
    alive[cell] = uniform(0.0F, 1.0F) < 0.6F;
    surfel.cell = cell;
    surfel.position_m = {uniform(-0.2F, 0.2F), uniform(-0.2F, 0.2F), uniform(0.5F, 0.8F)};
    surfel.inward_normal = Eigen::Vector3f(uniform(-1.0F, 1.0F), uniform(-1.0F, 1.0F), 1.0F).normalized();
    surfel.radius_min_m = uniform(0.005F, 0.03F);
    surfel.radius_max_m = surfel.radius_min_m + uniform(0.0F, 0.03F);
  }
};

TEST(Recast, AfterAnySequenceOfFramesTheMapIsTheOneMadeAnewFromTheLastBitForBit) {
  constexpr double kCell_m = 0.004;
  SurfelStream stream;
  AccumulationMap votes(kCell_m);
  CastVotes cast;
  for (int frame = 0; frame < 400; ++frame) {
    const auto surfels = frame % 97 == 96 ? std::vector<Surfel>{} : stream.next();
    recast(votes, cast, surfels);
    ASSERT_EQ(cast.now.size(), surfels.size());
    AccumulationMap anew(kCell_m);
    for (const Surfel& surfel : surfels) anew.add(vote_record(surfel, kCell_m));
    ASSERT_EQ(votes.block_count(), anew.block_count()) << frame;
    ASSERT_EQ(votes.peaks(2, 1), anew.peaks(2, 1)) << frame;
    if (frame % 23 != 0) continue;
    for (int z = 110; z < 230; ++z) {
      for (int y = -60; y < 60; ++y) {
        for (int x = -60; x < 60; ++x) ASSERT_EQ(votes.at({z, y, x}), anew.at({z, y, x})) << z << ' ' << y << ' ' << x;
      }
    }
  }
}

TEST(Recast, WhenAllIsWithdrawnNoBlockIsLeft) {
  SurfelStream stream;
  AccumulationMap votes(0.004);
  CastVotes cast;
  for (int frame = 0; frame < 20; ++frame) recast(votes, cast, stream.next());
  ASSERT_GT(votes.block_count(), 100U);
  recast(votes, cast, {});
  EXPECT_EQ(votes.block_count(), 0U);
  EXPECT_TRUE(votes.peaks(1, 1).empty());
}

}  // namespace
}  // namespace tubetrack
