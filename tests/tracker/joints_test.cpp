#include "tubetrack/tracker/joints.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

namespace tubetrack {
namespace {

using Eigen::Vector3d;

Tube straight(std::int64_t id, const Vector3d& from_m, const Vector3d& to_m, double radius_m) {
  Tube tube;
  tube.id = id;
  tube.radius_m = radius_m;
  constexpr int kNodes = 40;
  for (int i = 0; i <= kNodes; ++i) tube.centerline_m.emplace_back(from_m + (to_m - from_m) * i / kNodes);
  return tube;
}

TEST(Joints, ThreeEndsThatPointAtEachOtherAreOneJoint) {
  std::vector<Tube> tubes;
  for (int i = 0; i < 3; ++i) {
    const double angle = 2.0 * M_PI * i / 3.0;
    const Vector3d along(std::cos(angle), std::sin(angle), 0.0);
    tubes.push_back(straight(i + 1, 0.015 * along, 0.1 * along, 0.01));
  }
  const auto joints = joints_of(tubes);
  ASSERT_EQ(joints.size(), 1U);
  EXPECT_EQ(joints[0].parts.size(), 3U);
  for (const TubeJoint::Part& part : joints[0].parts) EXPECT_EQ(part.at, TubeJoint::At::start);
  EXPECT_LE(joints[0].position_m.norm(), 0.01);
}

TEST(Joints, AnEndThatPointsAtAFlankIsJoinedThere) {
  const std::vector<Tube> tubes{straight(1, {-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}, 0.010),
                                straight(2, {0.03, 0.1, 0.0}, {0.03, 0.015, 0.0}, 0.006)};
  const auto joints = joints_of(tubes);
  ASSERT_EQ(joints.size(), 1U);
  ASSERT_EQ(joints[0].parts.size(), 2U);
  EXPECT_EQ(joints[0].parts[0].tube, 2);
  EXPECT_EQ(joints[0].parts[0].at, TubeJoint::At::end);
  EXPECT_NEAR(joints[0].parts[0].along_m, 0.085, 1e-9);
  EXPECT_EQ(joints[0].parts[1].tube, 1);
  EXPECT_EQ(joints[0].parts[1].at, TubeJoint::At::flank);
  EXPECT_NEAR(joints[0].parts[1].along_m, 0.13, 0.003);
  EXPECT_NEAR(joints[0].position_m.x(), 0.03, 0.003);
  EXPECT_NEAR(joints[0].position_m.y(), 0.0, 1e-9);
}

TEST(Joints, AnEndWithinAnotherTubeIsJoinedWhereverItPoints) {
  const std::vector<Tube> tubes{straight(1, {-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}, 0.010),
                                straight(2, {0.03, 0.005, -0.1}, {0.03, 0.005, 0.0}, 0.006)};
  const auto joints = joints_of(tubes);
  ASSERT_EQ(joints.size(), 1U);
  EXPECT_EQ(joints[0].parts.size(), 2U);
}

TEST(Joints, TubesThatPassOrPointElsewhereAreNot) {
  const Tube first = straight(1, {-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}, 0.010);
  EXPECT_TRUE(joints_of({}).empty());
  EXPECT_TRUE(joints_of(std::vector{first}).empty());
  // Beside each other; across, touching; an end too far off.
  EXPECT_TRUE(joints_of(std::vector{first, straight(2, {-0.1, 0.021, 0.0}, {0.1, 0.021, 0.0}, 0.010)}).empty());
  EXPECT_TRUE(joints_of(std::vector{first, straight(2, {0.0, -0.1, 0.02}, {0.0, 0.1, 0.02}, 0.010)}).empty());
  EXPECT_TRUE(joints_of(std::vector{first, straight(2, {0.0, 0.2, 0.0}, {0.0, 0.05, 0.0}, 0.010)}).empty());
}

TEST(Joints, AClosedTubeIsMetAtItsFlank) {
  Tube ring;
  ring.id = 1;
  ring.radius_m = 0.01;
  ring.closed = true;
  for (int i = 0; i <= 90; ++i)
    ring.centerline_m.emplace_back(0.05 * std::cos(M_PI * i / 45), 0.05 * std::sin(M_PI * i / 45), 0.0);
  const auto joints = joints_of(std::vector{ring, straight(2, {0.2, 0.0, 0.0}, {0.065, 0.0, 0.0}, 0.006)});
  ASSERT_EQ(joints.size(), 1U);
  EXPECT_EQ(joints[0].parts[1].at, TubeJoint::At::flank);
}

}  // namespace
}  // namespace tubetrack
