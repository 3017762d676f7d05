#include "tubetrack/tracker/bend_table.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "bent_tubes.hpp"
#include "tube_result.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

constexpr double kR = 0.0125;

/// Along x from the origin, first bend towards y; sure of everything.
FittedChain sure(const std::vector<ChainBend>& bends, double closing_m) {
  FittedChain fitted;
  fitted.chain.bends.assign(bends.begin(), bends.end());
  fitted.chain.closing_m = closing_m;
  fitted.sigma.assign(bends.size(), {1e-4, 1e-3, 1e-3, 1e-4});
  fitted.closing_sigma_m = 1e-4;
  return fitted;
}

void expect_points(const std::vector<Vector3d>& points, const std::vector<Vector3d>& expected) {
  ASSERT_EQ(points.size(), expected.size());
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LT((points[i] - expected[i]).norm(), 1e-12) << i;
}

TEST(BendTable, OfAStraightTubeIsItsLength) {
  const BendTable table = bend_table_of(sure({}, 0.5));
  expect_points(table.xyz_m, {{0, 0, 0}, {0.5, 0, 0}});
  ASSERT_EQ(table.lra.size(), 1U);
  EXPECT_EQ(table.lra[0].length_m, 0.5);
  EXPECT_EQ(table.lra[0].angle_rad, 0.0);
  EXPECT_FALSE(table.lra[0].ill_conditioned);
}

TEST(BendTable, HasARowABendAndTheClosingLength) {
  // After the first bend the tube runs along y; a quarter turn of the plane about it takes −x to z.
  const BendTable table = bend_table_of(sure({{0.2, 0.0, M_PI / 2, 0.1}, {0.3, M_PI / 2, M_PI / 2, 0.05}}, 0.15));
  expect_points(table.xyz_m, {{0, 0, 0}, {0.3, 0, 0}, {0.3, 0.45, 0}, {0.3, 0.45, 0.2}});
  ASSERT_EQ(table.lra.size(), 3U);
  EXPECT_EQ(table.lra[0].length_m, 0.2);
  EXPECT_EQ(table.lra[0].rotation_rad, 0.0);
  EXPECT_EQ(table.lra[0].bend_radius_m, 0.1);
  EXPECT_EQ(table.lra[1].length_m, 0.3);
  EXPECT_EQ(table.lra[1].rotation_rad, M_PI / 2);
  EXPECT_EQ(table.lra[1].angle_rad, M_PI / 2);
  EXPECT_EQ(table.lra[2].length_m, 0.15);
  EXPECT_EQ(table.lra[2].angle_rad, 0.0);
  EXPECT_EQ(table.lra[2].bend_radius_m, 0.0);
  for (const BendRow& row : table.lra) EXPECT_FALSE(row.ill_conditioned);
}

TEST(BendTable, RotationsAreBetweenMinusPiExclusiveAndPi) {
  for (const auto& [given, expected] :
       {std::pair(M_PI, M_PI), std::pair(-M_PI, M_PI), std::pair(1.5 * M_PI, -0.5 * M_PI),
        std::pair(-5.5 * M_PI, 0.5 * M_PI), std::pair(-0.1, -0.1)}) {
    const BendTable table = bend_table_of(sure({{0.2, 0.7, 1.0, 0.1}, {0.3, given, 1.0, 0.05}}, 0.15));
    EXPECT_EQ(table.lra[0].rotation_rad, 0.0);
    EXPECT_NEAR(table.lra[1].rotation_rad, expected, 1e-12);
  }
}

TEST(BendTable, AUBendIsSplitAtItsMiddleInXyzAlone) {
  const BendTable table = bend_table_of(sure({{0.2, 0.0, M_PI, 0.1}}, 0.15));
  expect_points(table.xyz_m, {{0, 0, 0}, {0.3, 0, 0}, {0.3, 0.2, 0}, {0.05, 0.2, 0}});
  ASSERT_EQ(table.lra.size(), 2U);
  EXPECT_EQ(table.lra[0].angle_rad, M_PI);
  EXPECT_EQ(bend_table_of(sure({{0.2, 0.0, 149.0 * M_PI / 180, 0.1}}, 0.15)).xyz_m.size(), 3U);
  EXPECT_EQ(bend_table_of(sure({{0.2, 0.0, 151.0 * M_PI / 180, 0.1}}, 0.15)).xyz_m.size(), 4U);
  EXPECT_EQ(bend_table_of(sure({{0.2, 0.0, 301.0 * M_PI / 180, 0.1}}, 0.15)).xyz_m.size(), 5U);
}

TEST(BendTable, SaysWhichRowsNotToTrust) {
  const std::vector<ChainBend> bends = {{0.2, 0.0, 1.0, 0.1}, {0.3, 1.0, 1.0, 0.05}};
  const auto flags = [](const FittedChain& of) {
    std::vector<bool> rows;
    for (const BendRow& row : bend_table_of(of).lra) rows.push_back(row.ill_conditioned);
    return rows;
  };
  using Flags = std::vector<bool>;
  FittedChain fitted = sure(bends, 0.15);
  EXPECT_EQ(flags(fitted), Flags({false, false, false}));
  fitted.sigma[0].angle_rad = 0.11;
  EXPECT_EQ(flags(fitted), Flags({true, false, false}));
  fitted = sure(bends, 0.15);
  fitted.sigma[1].radius_m = 0.0051;
  EXPECT_EQ(flags(fitted), Flags({false, true, false}));
  fitted = sure(bends, 0.15);
  fitted.sigma[1].rotation_rad = 0.11;
  EXPECT_EQ(flags(fitted), Flags({false, true, false}));
  fitted = sure(bends, 1e-5);  // the view ends in the last bend
  EXPECT_EQ(flags(fitted), Flags({false, true, true}));
  fitted = sure(bends, 0.15);
  fitted.chain.bends[0].straight_m = 0.0;  // or begins in the first
  EXPECT_EQ(flags(fitted), Flags({true, false, false}));
  fitted = sure(bends, 0.15);
  fitted.sigma[0].angle_rad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(flags(fitted), Flags({true, false, false}));
}

RC_GTEST_PROP(BendTable, AndBackIsTheSameTube, (std::uint64_t seed)) {
  std::mt19937_64 random(seed);
  FittedChain fitted;
  fitted.chain = test::random_chain(random, seed % 7, kR);
  fitted.sigma.resize(fitted.chain.bends.size());
  const std::optional<PartChain> again = chain_of(bend_table_of(fitted));
  RC_ASSERT(again.has_value());
  const auto expected = points_along(fitted.chain, 0.5 * kR);
  const auto found = points_along(*again, 0.5 * kR);
  RC_ASSERT(found.size() == expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) RC_ASSERT((found[i] - expected[i]).norm() < 1e-9);
}

RC_GTEST_PROP(BendTable, OfTheTubeFromItsOtherEndIsTheSameRowsBackwards, (std::uint64_t seed)) {
  std::mt19937_64 random(seed);
  FittedChain there;
  there.chain = test::random_chain(random, seed % 7, kR);
  there.sigma.resize(there.chain.bends.size());
  FittedChain back = there;
  back.chain = test::reversed(there.chain);
  const BendTable a = bend_table_of(there);
  const BendTable b = bend_table_of(back);
  RC_ASSERT(a.xyz_m.size() == b.xyz_m.size());
  for (std::size_t i = 0; i < a.xyz_m.size(); ++i) {
    RC_ASSERT((a.xyz_m[i] - b.xyz_m[b.xyz_m.size() - 1 - i]).norm() < 1e-9);
  }
}

TEST(BendTable, TheCenterlineRunsFromEndToEndOnTheTube) {
  const BendTable table = bend_table_of(sure({{0.2, 0.0, M_PI / 2, 0.1}}, 0.15));
  const auto line = centerline_of(table, 0.002);
  ASSERT_FALSE(line.empty());
  EXPECT_LT((line.front() - table.xyz_m.front()).norm(), 1e-12);
  EXPECT_LT((line.back() - table.xyz_m.back()).norm(), 1e-12);
  for (std::size_t i = 1; i < line.size(); ++i) EXPECT_LE((line[i] - line[i - 1]).norm(), 0.002 + 1e-12);
  for (const Vector3d& point : line) {
    const double off_m = point.x() <= 0.2   ? std::abs(point.y())
                         : point.y() >= 0.1 ? std::abs(point.x() - 0.3)
                                            : std::abs((point - Vector3d(0.2, 0.1, 0.0)).norm() - 0.1);
    EXPECT_LT(off_m, 1e-12);
  }
  EXPECT_TRUE(centerline_of(table, 0.0).empty());
  EXPECT_TRUE(centerline_of(table, std::numeric_limits<double>::quiet_NaN()).empty());
}

TEST(BendTable, ThatIsNoTubeGivesNoChain) {
  const BendTable good = bend_table_of(sure({{0.2, 0.0, 1.0, 0.1}}, 0.15));
  ASSERT_TRUE(chain_of(good));
  EXPECT_FALSE(chain_of({}));
  const auto refused = [&](auto&& spoil) {
    BendTable table = good;
    spoil(table);
    return !chain_of(table) && centerline_of(table, 0.01).empty();
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refused([](BendTable& t) { t.xyz_m.resize(1); }));
  EXPECT_TRUE(refused([](BendTable& t) { t.xyz_m[1] = t.xyz_m[0]; }));
  EXPECT_TRUE(refused([&](BendTable& t) { t.xyz_m[2].z() = nan; }));
  EXPECT_TRUE(refused([](BendTable& t) { t.lra.clear(); }));
  EXPECT_TRUE(refused([](BendTable& t) { t.lra.pop_back(); }));
  EXPECT_TRUE(refused([](BendTable& t) { t.lra[0].length_m = -0.1; }));
  EXPECT_TRUE(refused([](BendTable& t) { t.lra[0].angle_rad = -1.0; }));
  EXPECT_TRUE(refused([](BendTable& t) { t.lra[0].bend_radius_m = 0.0; }));
  EXPECT_TRUE(refused([&](BendTable& t) { t.lra[0].rotation_rad = nan; }));
  EXPECT_TRUE(refused([&](BendTable& t) { t.lra[1].length_m = nan; }));
}

Tube measured_tube(const PartChain& chain) {
  std::mt19937_64 random(3);
  const test::OwnedLine line = test::noisy_line(chain, kR, 0.005 * kR, 2.5 * kR, random);
  Tube tube;
  tube.radius_m = kR;
  tube.centerline_m = line.nodes_m;
  tube.node_covariance_m2 = line.covariance_m2;
  return tube;
}

TEST(AddParts, FillsInSegmentsAndTableWhichMoveToTheWorld) {
  std::mt19937_64 random(4);
  Tube tube = measured_tube(test::random_chain(random, 2, kR));
  add_parts(tube);
  EXPECT_EQ(tube.segments.size(), 5U);
  ASSERT_EQ(tube.bend_table.lra.size(), 3U);
  const BendTable before = tube.bend_table;
  Eigen::Isometry3d world_from_camera(Eigen::AngleAxisd(1.0, Vector3d(1, 2, 3).normalized()));
  world_from_camera.pretranslate(Vector3d(0.5, -1.0, 2.0));
  move_to_world(tube, world_from_camera);
  ASSERT_EQ(tube.bend_table.xyz_m.size(), before.xyz_m.size());
  for (std::size_t i = 0; i < before.xyz_m.size(); ++i) {
    EXPECT_LT((tube.bend_table.xyz_m[i] - world_from_camera * before.xyz_m[i]).norm(), 1e-12);
  }
  EXPECT_LT((tube.bend_table.xyz_m.front() - tube.centerline_m.front()).norm(), 0.02 * kR);
  EXPECT_LT((tube.bend_table.xyz_m.back() - tube.centerline_m.back()).norm(), 0.02 * kR);
}

TEST(AddParts, OfATubeThatIsPartlyFreeGivesNoTable) {
  Tube tube;
  tube.radius_m = kR;
  for (int i = 0; i < 100; ++i) {
    const double t = 0.07 * i;
    tube.centerline_m.emplace_back(kR * Vector3d(6.0 * std::cos(t), 6.0 * std::sin(t), 3.0 * t));
    tube.node_covariance_m2.emplace_back(1e-9 * Eigen::Matrix3d::Identity());
  }
  tube.bend_table = bend_table_of(sure({}, 0.5));
  add_parts(tube);
  EXPECT_FALSE(tube.segments.empty());
  EXPECT_TRUE(tube.bend_table.lra.empty());
  EXPECT_TRUE(tube.bend_table.xyz_m.empty());
}

}  // namespace
}  // namespace tubetrack
