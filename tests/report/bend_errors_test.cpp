#include "tubetrack/report/bend_errors.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tubetrack {
namespace {

constexpr double kBentRadius_m = 0.015;

/// A tube with two bends of 1.2 and 0.9 rad, 0.5 rad between their planes.
TruthFrame two_bends() {
  TrueTube tube;
  tube.radius_m = kBentRadius_m;
  tube.centerline_m = {{0.0, 0.0, 0.8}, {0.1, 0.0, 0.8}};
  tube.bends = {{0.09, 1.2, 0.0}, {0.10, 0.9, 0.5}};
  TruthFrame truth;
  truth.tubes = {tube};
  return truth;
}

TubeFrame result_with(std::vector<BendRow> rows) {
  TubeFrame result;
  Tube tube;
  tube.centerline_m = {{0.0, 0.001, 0.8}, {0.1, 0.001, 0.8}};
  tube.bend_table.lra = std::move(rows);
  result.tubes = {tube};
  return result;
}

BendRow row(double angle_rad, double bend_radius_m, double rotation_rad) {
  BendRow row;
  row.angle_rad = angle_rad;
  row.bend_radius_m = bend_radius_m;
  row.rotation_rad = rotation_rad;
  return row;
}

TEST(BendErrors, AreThoseOfTheTableWhicheverEndItStartsFrom) {
  const TruthFrame truth = two_bends();
  for (const bool reversed : {false, true}) {
    std::vector<BendRow> rows = {row(1.21, 0.0909, 0.0), row(0.89, 0.10, 0.52), row(0.0, 0.0, 0.0)};
    if (reversed) rows = {row(0.89, 0.10, 0.0), row(1.21, 0.0909, 0.52), row(0.0, 0.0, 0.0)};
    BendErrors errors = bend_errors(truth, result_with(rows));
    EXPECT_EQ(errors.tubes_right, 1);
    std::ranges::sort(errors.bend_radius_relative);
    ASSERT_EQ(errors.angle_rad.size(), 2U);
    for (const double angle : errors.angle_rad) EXPECT_NEAR(angle, 0.01, 1e-12);
    EXPECT_NEAR(errors.bend_radius_relative[0], 0.0, 1e-12);
    EXPECT_NEAR(errors.bend_radius_relative[1], 0.01, 1e-12);
    ASSERT_EQ(errors.rotation_rad.size(), 1U);
    EXPECT_NEAR(errors.rotation_rad[0], 0.02, 1e-12);
  }
}

TEST(BendErrors, ATubeWithAnotherNumberOfBendsCountsAsWrongAndNotInTheMedians) {
  const TruthFrame truth = two_bends();
  const BendErrors errors = bend_errors(truth, result_with({row(1.2, 0.09, 0.0), row(0.0, 0.0, 0.0)}));
  EXPECT_EQ(errors.tubes, 1);
  EXPECT_EQ(errors.tubes_right, 0);
  EXPECT_TRUE(errors.angle_rad.empty());
}

TEST(BendErrors, OnlyBendsThatTheGoalIsForCount) {
  TruthFrame truth = two_bends();
  truth.tubes[0].bends[0].bend_radius_m = 0.06;  // below 2.5 diameters
  const BendErrors errors =
      bend_errors(truth, result_with({row(1.2, 0.06, 0.0), row(0.9, 0.1, 0.5), row(0.0, 0.0, 0.0)}));
  EXPECT_EQ(errors.tubes_right, 1);
  EXPECT_EQ(errors.angle_rad.size(), 1U);
  EXPECT_TRUE(errors.rotation_rad.empty());
}

}  // namespace
}  // namespace tubetrack
