#include "confidence.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tubetrack {
namespace {

Evidence look(double taper, double sigma) {
  Evidence evidence;
  evidence.taper = taper;
  evidence.taper_sigma = sigma;
  return evidence;
}

double confidence_after(int looks, double taper, double sigma) {
  FollowedTube tube;
  tube.support = 0.95;
  for (int i = 0; i < looks; ++i) add_look(tube, look(taper, sigma));
  return confidence_of(tube);
}

TEST(Confidence, IsTheSupportOfATubeWhoseTaperIsKnownToBeSmall) {
  EXPECT_NEAR(confidence_after(1, 0.001, 0.003), 0.95, 1e-9);
}

TEST(Confidence, OfAFingerWhoseTaperIsUnsureIsLowAndOneMoreLookTells) {
  EXPECT_NEAR(confidence_after(1, 0.05, 0.03), 0.95 * 0.5, 1e-3);
  EXPECT_GT(confidence_after(1, 0.0, 0.03), 0.85);
  EXPECT_LT(confidence_after(10, 0.07, 0.03), 0.02);
  EXPECT_GT(confidence_after(10, 0.02, 0.03), 0.945);
}

TEST(Confidence, IsTheSameWhicheverWayItTapers) {
  EXPECT_NEAR(confidence_after(2, 0.04, 0.02), confidence_after(2, -0.04, 0.02), 1e-12);
}

TEST(Confidence, NoNumberOfLooksMakesATaperSurerThanASensorShowsIt) {
  EXPECT_NEAR(confidence_after(100000, 0.05, 0.03), 0.95 * 0.5, 1e-6);
  EXPECT_GT(confidence_after(100000, 0.06, 0.03), 0.01);
}

TEST(Confidence, IsNothingOutOfSightOrWithoutALook) {
  FollowedTube tube;
  tube.support = 1.0;
  EXPECT_EQ(confidence_of(tube), 0.0);
  add_look(tube, look(0.0, 0.01));
  add_look(tube, look(std::nan(""), std::numeric_limits<double>::infinity()));
  EXPECT_NEAR(confidence_of(tube), 1.0, 1e-5);
  tube.state = TubeState::occluded;
  EXPECT_EQ(confidence_of(tube), 0.0);
}

}  // namespace
}  // namespace tubetrack
