#include "tubetrack/tracker/associate.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tubetrack {
namespace {

using Eigen::Vector3d;

Tube tube_at(const Vector3d& middle_m, double radius_m = 0.02, double length_m = 0.4) {
  Tube tube;
  tube.radius_m = radius_m;
  for (int i = -20; i <= 20; ++i) tube.centerline_m.push_back(middle_m + Vector3d(length_m / 40.0 * i, 0.0, 0.0));
  return tube;
}

std::vector<std::int64_t> ids_of(Identities& identities, std::vector<Tube> tubes) {
  associate(identities, tubes);
  std::vector<std::int64_t> ids;
  ids.reserve(tubes.size());
  for (const Tube& tube : tubes) ids.push_back(tube.id);
  return ids;
}

using Ids = std::vector<std::int64_t>;

TEST(CenterlineDistance, IsTheMeanDistanceFromTheOtherLine) {
  EXPECT_NEAR(centerline_distance_m(tube_at({0, 0, 0.8}), tube_at({0, 0.03, 0.84})), 0.05, 1e-12);
  // 41 nodes 10 mm apart, of which 20 lie 10, 20, … 200 mm beyond the other's end
  EXPECT_NEAR(centerline_distance_m(tube_at({0, 0, 1}), tube_at({-0.2, 0, 1})), 20 * 21 / 2 * 0.01 / 41, 1e-12);
}

TEST(CenterlineDistance, IsInfiniteWhereALineIsEmpty) {
  Tube none;
  EXPECT_TRUE(std::isinf(centerline_distance_m(none, tube_at({0, 0, 1}))));
  EXPECT_TRUE(std::isinf(centerline_distance_m(tube_at({0, 0, 1}), none)));
}

TEST(Associate, NewTubesGetNewIdsInTheirOrder) {
  Identities identities;
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0, 0.8}), tube_at({0, 0.2, 0.8})}), (Ids{1, 2}));
}

TEST(Associate, IdsPersistThroughMotionWhateverTheOrder) {
  Identities identities;
  ids_of(identities, {tube_at({0, 0, 0.8}), tube_at({0, 0.2, 0.8})});
  for (int frame = 1; frame <= 20; ++frame) {
    const double y = 0.005 * frame;
    EXPECT_EQ(ids_of(identities, {tube_at({0, 0.2 - y, 0.8}), tube_at({0, -y, 0.8})}), (Ids{2, 1})) << frame;
  }
}

TEST(Associate, OfTwoCandidatesTheNearerKeepsTheId) {
  Identities identities;
  ids_of(identities, {tube_at({0, 0, 0.8})});
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0.03, 0.8}), tube_at({0, -0.01, 0.8})}), (Ids{2, 1}));
}

TEST(Associate, ADiameterAwayIsAnotherTube) {
  Identities identities;
  ids_of(identities, {tube_at({0, 0, 0.8})});
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0.0399, 0.8})}), (Ids{1}));
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0.0399 + 0.0401, 0.8})}), (Ids{2}));
}

TEST(Associate, ARadiusThatDiffersByMoreThanAQuarterIsAnotherTube) {
  Identities identities;
  ids_of(identities, {tube_at({0, 0, 0.8}, 0.020)});
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0, 0.8}, 0.0151)}), (Ids{1}));
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0, 0.8}, 0.0202)}), (Ids{2}));
}

TEST(Associate, APartOfATubeIsThatTube) {
  Identities identities;
  ids_of(identities, {tube_at({0, 0, 0.8}, 0.02, 0.4)});
  EXPECT_EQ(ids_of(identities, {tube_at({0.15, 0, 0.8}, 0.02, 0.08)}), (Ids{1}));
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0, 0.8}, 0.02, 0.4)}), (Ids{1}));
}

TEST(Associate, ATubeIsForgottenAfter30FramesAway) {
  Identities identities;
  ids_of(identities, {tube_at({0, 0, 0.8})});
  for (int frame = 0; frame < 30; ++frame) ids_of(identities, {});
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0, 0.8})}), (Ids{1}));
  for (int frame = 0; frame < 31; ++frame) ids_of(identities, {});
  EXPECT_EQ(ids_of(identities, {tube_at({0, 0, 0.8})}), (Ids{2}));
  EXPECT_EQ(identities.known.size(), 1U);
}

TEST(Associate, NoIdIsEverGivenTwice) {
  Identities identities;
  std::int64_t last = 0;
  for (int frame = 0; frame < 100; ++frame) {
    const auto ids = ids_of(identities, {tube_at({0, 0.1 * frame, 0.8})});
    EXPECT_GT(ids[0], last);
    last = ids[0];
  }
}

}  // namespace
}  // namespace tubetrack
