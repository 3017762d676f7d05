// Tubes of the accuracy suite that once were far off, or far outside their intervals, in a single frame or a sequence.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>

#include "run.hpp"
#include "tubetrack/report/score.hpp"

namespace tubetrack::bench {
namespace {

/// What a fresh tracker says of one true tube, by its number from 1, in the first frame of a scene.
struct Seen {
  double radius_error_m = std::numeric_limits<double>::infinity();
  double radius_sigma_m = 0.0;
  double farthest_m = std::numeric_limits<double>::infinity();  ///< of its nodes from the true axis, but past its ends
};

Seen look(std::string_view row_name, std::uint64_t seed, std::int64_t id) {
  const auto row = std::ranges::find(rows(), row_name, &Row::name);
  const SuiteScene suite = make_scene(*row, seed);
  const RenderedFrame rendered = render(suite, 0, {});
  const Detector detector = tubetrack_method().start(suite.scene.camera);
  const TubeFrame result = detector(depth_frame(rendered));
  const TrueTube& truth = rendered.truth.tubes[static_cast<std::size_t>(id - 1)];
  Seen seen;
  for (const Tube& tube : result.tubes) {
    double farthest_m = 0.0;
    for (const Eigen::Vector3d& point : tube.centerline_m) {
      const LineFoot foot = foot_on_line(point, truth.centerline_m);
      farthest_m = std::max(farthest_m, foot.beyond_end && foot.distance_m < truth.radius_m ? 0.0 : foot.distance_m);
    }
    if (farthest_m > truth.radius_m) continue;
    seen = {tube.radius_m - truth.radius_m, tube.radius_sigma_m, farthest_m};
  }
  return seen;
}

// Its first short piece lay aside: one silhouette at 0.85 R, the other at 0.6 R, and their mean was held.
TEST(HardTubes, ASilhouetteThatContradictsAloneHoldsNoRadius) {
  const Seen seen = look("pile", 71, 1);
  EXPECT_LT(std::abs(seen.radius_error_m), 0.0003);
  EXPECT_GT(seen.radius_sigma_m, 0.0001);
}

// 13 px wide, so a short piece tells its curvature to 13 %: what contradicted the silhouettes was noise.
TEST(HardTubes, NoiseThatContradictsTheSilhouettesHoldsNoRadius) {
  const Seen seen = look("thin", 1500012, 1);
  EXPECT_LT(std::abs(seen.radius_error_m), 0.00015);
  EXPECT_LT(std::abs(seen.radius_error_m), 2.0 * seen.radius_sigma_m);
}

// Its far end is seen for a few pixels, 100 mm behind another tube. Left out of the fit as an end, it came out 6 mm
// off.
TEST(HardTubes, AnEndThatIsSeenLittleBeyondAGapHoldsTheLine) {
  EXPECT_LT(look("pile", 47, 2).farthest_m, 0.0015);
  EXPECT_LT(look("pile", 115, 4).farthest_m, 0.0015);
}

// A shadow lies along it: what the jitter moved over its edge is missing, and the radius was 6.5 sigma off.
TEST(HardTubes, ReadingsAtTheEdgeOfAShadowDoNotPull) {
  const Seen seen = look("pile", 101, 1);
  EXPECT_LT(std::abs(seen.radius_error_m), 2.0 * seen.radius_sigma_m);
}

/// One sequence: `accuracy_suite --row … --count 0 --sequences 1 --first …`.
Figures follow(std::string_view row_name, std::uint64_t scene) {
  RunOptions options;
  options.first_seed = 1 + scene;
  options.single_scenes = 0;
  options.sequences = 1;
  const auto row = std::ranges::find(rows(), row_name, &Row::name);
  return run_row(*row, {tubetrack_method()}, options, [] {}).front().sequence;
}

// The hand that comes over it pulls at it; it was taken to move along, and was millimetres off.
TEST(HardTubes, ATubeAtRestStaysWhereItIsBehindAHandThatMoves) {
  EXPECT_LT(follow("hand", 30).score.rms_m(), 0.00009);
  EXPECT_LT(follow("hand", 44).score.rms_m(), 0.00012);
}

// It came back to where it had left; expected 0.5 m on, at its last speed, it was another tube.
TEST(HardTubes, ATubeThatTurnsBackOutOfSightKeepsItsId) {
  const Figures figures = follow("leaving", 42);
  EXPECT_EQ(figures.score.switches, 0);
  EXPECT_GT(figures.score.idf1(), 0.99);
}

// In the frame in which a last strip of it was left it was followed still, millimetres off.
TEST(HardTubes, ATubeThatLeavesIsGivenUpWithItsLastStrip) {
  EXPECT_LT(follow("leaving", 107).score.rms_m(), 0.00016);
}

}  // namespace
}  // namespace tubetrack::bench
