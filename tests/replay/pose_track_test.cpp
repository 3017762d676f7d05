#include "pose_track.hpp"

#include <gmock/gmock.h>
#include <rapidcheck.h>

#include <cmath>

#include "recording_files.hpp"

namespace tubetrack {
namespace {

using test::TemporaryFolder;
using test::write_text;
using ::testing::HasSubstr;

double angle_between(const Eigen::Isometry3d& a, const Eigen::Quaterniond& b) {
  return Eigen::Quaterniond(a.linear()).angularDistance(b);
}

StampedPose pose(double timestamp_s, const Eigen::Vector3d& translation_m = Eigen::Vector3d::Zero()) {
  return {timestamp_s, translation_m, Eigen::Quaterniond::Identity()};
}

TEST(PoseTrack, AFrameFartherThan20MsFromEveryPoseHasNone) {
  const std::vector<StampedPose> track = {pose(1.0), pose(2.0)};
  EXPECT_TRUE(pose_at(track, 1.020).has_value());
  EXPECT_FALSE(pose_at(track, 1.021).has_value());
  EXPECT_FALSE(pose_at(track, 1.5).has_value());
  EXPECT_TRUE(pose_at(track, 1.980).has_value());
  EXPECT_TRUE(pose_at(track, 0.981).has_value());
  EXPECT_FALSE(pose_at(track, 0.979).has_value());
  EXPECT_TRUE(pose_at(track, 2.019).has_value());
  EXPECT_FALSE(pose_at(track, 2.021).has_value());
  EXPECT_FALSE(pose_at({}, 1.0).has_value());
}

TEST(PoseTrack, TheLimitHoldsForStampsOfTheCurrentCentury) {
  const std::vector<StampedPose> track = {pose(1700000000.5)};
  EXPECT_TRUE(pose_at(track, 1700000000.52).has_value());
  EXPECT_FALSE(pose_at(track, 1700000000.5201).has_value());
}

TEST(PoseTrack, BeyondTheEndsTheOutermostPoseStays) {
  const std::vector<StampedPose> track = {pose(1.0, {1, 2, 3}), pose(1.03, {4, 5, 6})};
  EXPECT_EQ(test::pose_or_nan(pose_at(track, 0.99)).translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(test::pose_or_nan(pose_at(track, 1.04)).translation(), Eigen::Vector3d(4, 5, 6));
}

rc::Gen<double> within(double limit) {
  return rc::gen::map(rc::gen::inRange(-1000000, 1000001), [limit](int n) { return limit * n / 1e6; });
}

StampedPose any_pose(double timestamp_s) {
  Eigen::Quaterniond q(*within(1), *within(1), *within(1), *within(1));
  RC_PRE(q.norm() > 0.01);
  return {timestamp_s, {*within(5), *within(5), *within(5)}, q.normalized()};
}

TEST(PoseTrack, BetweenTwoPosesMotionIsEvenAndTheRotationStaysARotation) {
  EXPECT_TRUE(rc::check("lerp and slerp", [] {
    const std::vector<StampedPose> track = {any_pose(3.0), any_pose(3.04)};
    const double part = *rc::gen::inRange(1, 1000) / 1000.0;
    const auto between = pose_at(track, 3.0 + 0.04 * part);
    RC_ASSERT(between.has_value());
    RC_ASSERT((between->linear() * between->linear().transpose()).isIdentity(1e-12));
    RC_ASSERT(std::abs(between->linear().determinant() - 1.0) < 1e-12);
    const double whole = track[0].rotation.angularDistance(track[1].rotation);
    RC_ASSERT(std::abs(angle_between(*between, track[0].rotation) - part * whole) < 1e-6);
    RC_ASSERT(std::abs(angle_between(*between, track[1].rotation) - (1 - part) * whole) < 1e-6);
    const Eigen::Vector3d expected = (1 - part) * track[0].translation_m + part * track[1].translation_m;
    RC_ASSERT((between->translation() - expected).norm() < 1e-9);
  }));
}

TEST(PoseTrack, AtItsOwnStampAPoseIsExact) {
  EXPECT_TRUE(rc::check("endpoints", [] {
    const std::vector<StampedPose> track = {any_pose(3.0), any_pose(3.01), any_pose(3.02)};
    for (const StampedPose& own : track) {
      const auto found = pose_at(track, own.timestamp_s);
      RC_ASSERT(found.has_value());
      RC_ASSERT(found->translation() == own.translation_m);
      RC_ASSERT(found->linear() == own.rotation.toRotationMatrix());
    }
  }));
}

TEST(PoseTrack, ReadsTumColumnsInOrderAndSortsByTime) {
  const TemporaryFolder folder;
  write_text(folder / "groundtruth.txt",
             "# timestamp tx ty tz qx qy qz qw\n2.0 0 0 0 0 0 0 1\r\n\n1.0 1 2 3 0.7071 0 0 0.7071\n");
  const auto track = read_pose_track(folder / "groundtruth.txt");
  ASSERT_TRUE(track.has_value()) << track.error().message;
  ASSERT_EQ(track->size(), 2u);
  EXPECT_EQ((*track)[0].timestamp_s, 1.0);
  EXPECT_EQ((*track)[0].translation_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR((*track)[0].rotation.norm(), 1.0, 1e-15);
  EXPECT_NEAR((*track)[0].rotation.x(), std::sqrt(0.5), 1e-12);
}

TEST(PoseTrack, ABadLineIsNamed) {
  const TemporaryFolder folder;
  const auto file = folder / "groundtruth.txt";
  const auto message = [&](const char* text) {
    write_text(file, text);
    const auto track = read_pose_track(file);
    return track ? std::string() : track.error().message;
  };
  EXPECT_THAT(message("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n"),
              HasSubstr("groundtruth.txt:2: got \"2 0 0 0 0 0 1\", takes 8"));
  EXPECT_THAT(message("1 0 0 nan 0 0 0 1\n"), HasSubstr("groundtruth.txt:1: "));
  EXPECT_THAT(message("1 0 0 0 0 0 0 0.5\n"), HasSubstr("got length 0.5, takes a unit quaternion"));
  EXPECT_THAT(message("# nothing\n"), HasSubstr("groundtruth.txt: no poses in it"));
}

TEST(PoseTrack, ALastLineCutShortIsLeftOut) {
  const TemporaryFolder folder;
  write_text(folder / "groundtruth.txt", "1 0 0 0 0 0 0 1\n2 0 0 0");
  const auto track = read_pose_track(folder / "groundtruth.txt");
  ASSERT_TRUE(track.has_value()) << track.error().message;
  EXPECT_EQ(track->size(), 1u);
}

}  // namespace
}  // namespace tubetrack
