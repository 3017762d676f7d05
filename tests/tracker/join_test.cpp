// Pieces of one tube.
#include "tubetrack/tracker/join.hpp"

#include <gtest/gtest.h>

#include "tracker/tube_scene.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

const Vector3d kMiddle(0.02, -0.01, 0.8);
const Vector3d kAxis = Vector3d(1.0, 0.3, 0.1).normalized();
constexpr double kRadius_m = 0.02;

HeightMap tube_in_view() {
  return cylinder_map({640, 480, 580.0, 580.0, 319.5, 239.5}, kMiddle, kAxis, 0.2, kRadius_m);
}

/// The tube from one place on its axis to another, as it is fitted.
FoundTube piece(const HeightMap& map, double from_m, double to_m) {
  FoundTube found;
  found.model = straight_model(kMiddle + 0.5 * (from_m + to_m) * kAxis, kAxis, 0.5 * (to_m - from_m), kRadius_m);
  const auto observations = select_observations(map, {}, predict_pixels(map, {}, found.model), 0.2 * kRadius_m, 4.0);
  found.quality = fit_tube(found.model, observations, {}).value();
  found.extent = {0.0, found.model.spline.spans()};
  found.pixels = predict_pixels(map, {}, found.model);
  found.evidence = gather_evidence(map, {}, found.model, found.pixels, found.extent);
  return found;
}

TEST(Join, PiecesWithAGapBetweenThemOrALittleWayInOneAnotherAreOneTube) {
  const HeightMap map = tube_in_view();
  for (const double gap_radii : {3.0, 1.0, 0.0, -1.0, -2.5}) {
    const double half_gap_m = 0.5 * gap_radii * kRadius_m;
    const FoundTube left = piece(map, -0.14, -half_gap_m);
    const FoundTube right = piece(map, half_gap_m, 0.14);
    const auto joined = join_pieces(map, {}, left, right);
    ASSERT_TRUE(joined) << "a gap of " << gap_radii << " radii";
    EXPECT_GT(joined->evidence.length_m, 0.23);  // but for its ends, along which it is lengthened when followed
    EXPECT_NEAR(joined->model.radius_m, kRadius_m, 1e-4);
  }
}

// As where the joined fit takes in the flank of a tube that it touches.
TEST(Join, PiecesWhoseJoinedFitLeavesTheRadiusOfBothStayTwo) {
  const HeightMap map = tube_in_view();
  FoundTube left = piece(map, -0.14, -0.02);
  FoundTube right = piece(map, 0.02, 0.14);
  for (FoundTube* found : {&left, &right}) {
    found->model.radius_m = 1.07 * kRadius_m;
    found->quality.radius_sigma_m = 0.001 * kRadius_m;
  }
  EXPECT_FALSE(join_pieces(map, {}, left, right));
}

TEST(Join, TubesSideBySideStayTwo) {
  const HeightMap map = tube_in_view();
  const FoundTube left = piece(map, -0.14, -0.02);
  FoundTube beside = piece(map, 0.02, 0.14);
  for (Vector3d& control : beside.model.spline.control_m) control += 2.0 * kRadius_m * kAxis.unitOrthogonal();
  EXPECT_FALSE(join_pieces(map, {}, left, beside));
}

}  // namespace
}  // namespace tubetrack
