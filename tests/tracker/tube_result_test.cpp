// What is added to a result's uncertainty beside the fit's own.
#include "tube_result.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tubetrack {
namespace {

/// A straight tube along x, 0.8 m away, known to 0.1 mm.
Tube known_tube() {
  Tube tube;
  tube.radius_m = 0.02;
  tube.radius_sigma_m = 1e-4;
  for (int i = 0; i < 5; ++i) {
    tube.centerline_m.emplace_back(0.01 * i - 0.02, 0.0, 0.8);
    tube.node_covariance_m2.push_back(1e-8 * Eigen::Matrix3d::Identity());
    tube.sigma_m.push_back(1e-4);
  }
  return tube;
}

TEST(CommonError, MakesTheRadiusAndThePlaceAlongTheLineOfSightLessSure) {
  Tube tube = known_tube();
  add_common_error(tube, 0.025);
  EXPECT_NEAR(tube.radius_sigma_m, std::hypot(1e-4, 5e-4), 1e-12);
  for (std::size_t i = 0; i < tube.sigma_m.size(); ++i) {
    EXPECT_NEAR(tube.sigma_m[i], std::hypot(1e-4, 5e-4), 1e-12) << i;
    EXPECT_NEAR(tube.node_covariance_m2[i](1, 1), 1e-8, 1e-15) << "sideways nothing is added";
    EXPECT_NEAR(tube.node_covariance_m2[i](2, 2), 1e-8 + 25e-8, 1e-14);
  }
}

TEST(CommonError, OfNothingChangesNothing) {
  Tube tube = known_tube();
  add_common_error(tube, 0.0);
  EXPECT_EQ(tube.radius_sigma_m, 1e-4);
  EXPECT_EQ(tube.sigma_m, known_tube().sigma_m);
}

TEST(UnseenMotion, AHiddenTubeIsLessSureTheLongerItIsHidden) {
  FollowedTube followed;
  followed.state = TubeState::occluded;
  followed.last_seen_s = 10.0;
  Tube resting = known_tube();
  add_unseen_motion(resting, followed, 12.0);
  EXPECT_NEAR(resting.sigma_m[2], std::hypot(1e-4, 0.002), 1e-12);
  EXPECT_NEAR(resting.node_covariance_m2[2](0, 0), 1e-8 + 4e-6, 1e-14);
  followed.at_rest = false;
  Tube moving = known_tube();
  add_unseen_motion(moving, followed, 10.2);
  EXPECT_NEAR(moving.sigma_m[2], std::hypot(1e-4, 0.02), 1e-9);
}

TEST(UnseenMotion, ATubeInSightIsAsSureAsItsFit) {
  FollowedTube followed;
  Tube tube = known_tube();
  add_unseen_motion(tube, followed, 12.0);
  EXPECT_EQ(tube.sigma_m, known_tube().sigma_m);
}

}  // namespace
}  // namespace tubetrack
