#include "tubetrack/report/score.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

namespace tubetrack {
namespace {

using testing::DoubleNear;
using testing::HasSubstr;

constexpr double kScoredRadius_m = 0.015;

std::vector<Eigen::Vector3d> line_along_x(double from_m, double to_m, double y_m, double step_m) {
  std::vector<Eigen::Vector3d> line;
  const int pieces = static_cast<int>(std::lround((to_m - from_m) / step_m));
  for (int i = 0; i <= pieces; ++i) line.emplace_back(from_m + (to_m - from_m) * i / pieces, y_m, 0.8);
  return line;
}

TrueTube true_tube(std::int64_t id, double y_m) {
  TrueTube tube;
  tube.id = id;
  tube.radius_m = kScoredRadius_m;
  tube.centerline_m = line_along_x(0.0, 0.4, y_m, 0.002);
  tube.visible.assign(tube.centerline_m.size(), true);
  return tube;
}

Tube reported_tube(std::int64_t id, double from_m, double to_m, double y_m) {
  Tube tube;
  tube.id = id;
  tube.radius_m = kScoredRadius_m;
  tube.centerline_m = line_along_x(from_m, to_m, y_m, 0.01);
  return tube;
}

TruthFrame truth_frame(std::int64_t number, std::vector<TrueTube> tubes) {
  return {number, 0.0, "camera", std::move(tubes)};
}

TubeFrame result_frame(std::int64_t number, std::vector<Tube> tubes) {
  TubeFrame frame;
  frame.frame = number;
  frame.status = tubes.empty() ? TrackStatus::empty : TrackStatus::ok;
  frame.tubes = std::move(tubes);
  return frame;
}

Score scored(const std::vector<TruthFrame>& truth, const std::vector<TubeFrame>& results,
             const ScoreRules& rules = {}) {
  auto score = score_run(truth, results, rules);
  EXPECT_TRUE(score) << score.error().message;
  return score.value_or(Score{});
}

Score scored_one(Tube tube) {
  return scored({truth_frame(0, {true_tube(1, 0.0)})}, {result_frame(0, {std::move(tube)})});
}

TEST(Score, AnExactLineIsPerfect) {
  const Score score = scored_one(reported_tube(9, 0.0, 0.4, 0.0));
  EXPECT_EQ(score.total.coverage(), 1.0);
  EXPECT_THAT(score.total.rms_m(), DoubleNear(0.0, 1e-12));
  EXPECT_EQ(score.total.false_length(), 0.0);
  EXPECT_EQ(score.total.idf1(), 1.0);
  EXPECT_EQ(score.total.switches, 0);
  EXPECT_THAT(score.total.reported_m, DoubleNear(0.4, 1e-12));
}

TEST(Score, LostTubesAreNotReportedAndOccludedOnesAre) {
  Tube occluded = reported_tube(9, 0.0, 0.4, 0.0);
  occluded.state = TubeState::occluded;
  EXPECT_EQ(scored_one(occluded).total.coverage(), 1.0);

  Tube lost = occluded;
  lost.state = TubeState::lost;
  const Score none = scored_one(lost);
  EXPECT_EQ(none.total.coverage(), 0.0);
  EXPECT_EQ(none.total.reported_m, 0.0);
  EXPECT_EQ(none.total.frames_found, 0);
  EXPECT_EQ(none.total.idf1(), 0.0);

  Tube elsewhere = reported_tube(4, 0.0, 0.4, 0.3);
  elsewhere.state = TubeState::lost;
  const Score score =
      scored({truth_frame(0, {true_tube(1, 0.0)})}, {result_frame(0, {elsewhere, reported_tube(9, 0.0, 0.4, 0.0)})});
  EXPECT_EQ(score.total.false_length(), 0.0);
  EXPECT_EQ(score.total.idf1(), 1.0);
}

TEST(Score, ALineShiftedByDHasRmsD) {
  const Score score = scored_one(reported_tube(9, 0.0, 0.4, 0.003));
  EXPECT_THAT(score.total.rms_m(), DoubleNear(0.003, 1e-12));
  EXPECT_EQ(score.total.coverage(), 1.0);
}

TEST(Score, ALineShiftedByMoreThanTheReachCoversNothingAndStillHasItsRms) {
  const Score score = scored_one(reported_tube(9, 0.0, 0.4, 0.36 * kScoredRadius_m));
  EXPECT_EQ(score.total.coverage(), 0.0);
  EXPECT_THAT(score.total.rms_m(), DoubleNear(0.36 * kScoredRadius_m, 1e-12));
  EXPECT_EQ(score.total.false_length(), 0.0);
}

TEST(Score, ASineOnTheLineHasTheRmsOfASine) {
  Tube tube = reported_tube(9, 0.0, 0.4, 0.0);
  tube.centerline_m = line_along_x(0.0, 0.4, 0.0, 0.0005);
  for (auto& p : tube.centerline_m) p.y() = 0.002 * std::sin(2.0 * std::numbers::pi * p.x() / 0.1);
  EXPECT_THAT(scored_one(tube).total.rms_m(), DoubleNear(0.002 / std::sqrt(2.0), 1e-5));
}

TEST(Score, HalfALineCoversHalf) {
  const Score score = scored_one(reported_tube(9, 0.0, 0.2, 0.0));
  // Samples 0, 2, …, 400 mm; those up to 200 mm + 0.35 R = 205.25 mm are within reach: 103 of 201.
  EXPECT_EQ(score.total.covered_samples, 103);
  EXPECT_EQ(score.total.visible_samples, 201);
  EXPECT_EQ(score.total.false_length(), 0.0);
}

TEST(Score, OnlyVisibleSamplesCountForCoverage) {
  TrueTube truth = true_tube(1, 0.0);
  for (std::size_t i = 101; i < truth.visible.size(); ++i) truth.visible[i] = false;
  const Score score = scored({truth_frame(0, {truth})}, {result_frame(0, {reported_tube(9, 0.0, 0.2, 0.0)})});
  EXPECT_EQ(score.total.coverage(), 1.0);
  EXPECT_EQ(score.total.visible_samples, 101);
}

TEST(Score, AFarLineIsFalse) {
  const Score score = scored({truth_frame(0, {true_tube(1, 0.0)})},
                             {result_frame(0, {reported_tube(9, 0.0, 0.4, 0.0), reported_tube(10, 0.0, 0.1, 0.3)})});
  EXPECT_THAT(score.total.false_length(), DoubleNear(0.1 / 0.5, 1e-12));
  EXPECT_THAT(score.total.rms_m(), DoubleNear(0.0, 1e-12));
  EXPECT_THAT(score.total.idf1(), DoubleNear(2.0 * 1 / (1 + 2), 1e-12));
}

TEST(Score, BeyondTheEndByLessThanTheRadiusIsNotFalseAndNotInTheRms) {
  const Score inside = scored_one(reported_tube(9, 0.0, 0.4 + 0.9 * kScoredRadius_m, 0.0));
  EXPECT_EQ(inside.total.false_length(), 0.0);
  EXPECT_THAT(inside.total.rms_m(), DoubleNear(0.0, 1e-12));
  // 31 mm too long: what is beyond R = 15 mm is false, to half the resampling step.
  const Score beyond = scored_one(reported_tube(9, 0.0, 0.431, 0.0));
  EXPECT_THAT(beyond.total.false_m, DoubleNear(0.016, 0.00101));
}

TEST(Score, ASceneWithoutTubesMakesEverythingFalse) {
  const Score score = scored({truth_frame(0, {})}, {result_frame(0, {reported_tube(9, 0.0, 0.4, 0.0)})});
  EXPECT_EQ(score.total.false_length(), 1.0);
  EXPECT_TRUE(std::isnan(score.total.coverage()));
  EXPECT_EQ(score.total.idf1(), 0.0);
}

TEST(Score, ASceneWithoutTubesAndReportsHasNothingToDivide) {
  const Score score = scored({truth_frame(0, {})}, {result_frame(0, {})});
  EXPECT_TRUE(std::isnan(score.total.false_length()));
  EXPECT_TRUE(std::isnan(score.total.idf1()));
  EXPECT_EQ(score.total.false_m, 0.0);
}

TEST(Score, RadiusErrorIsTheMedianOverFrames) {
  std::vector<TruthFrame> truth;
  std::vector<TubeFrame> results;
  for (const double factor : {1.01, 0.98, 1.10}) {
    const auto number = static_cast<std::int64_t>(truth.size());
    truth.push_back(truth_frame(number, {true_tube(1, 0.0)}));
    Tube tube = reported_tube(9, 0.0, 0.4, 0.0);
    tube.radius_m = factor * kScoredRadius_m;
    results.push_back(result_frame(number, {tube}));
  }
  EXPECT_THAT(scored(truth, results).total.radius_error_median(), DoubleNear(0.02, 1e-12));
}

/// Ten frames of two tubes; the reported ids are those that `ids(frame)` gives for the upper and the lower.
template <class Ids>
Score two_tubes(Ids&& ids) {
  std::vector<TruthFrame> truth;
  std::vector<TubeFrame> results;
  for (std::int64_t f = 0; f < 10; ++f) {
    truth.push_back(truth_frame(f, {true_tube(1, 0.0), true_tube(2, 0.1)}));
    const std::pair<int, int> pair = ids(f);
    results.push_back(
        result_frame(f, {reported_tube(pair.first, 0.0, 0.4, 0.0), reported_tube(pair.second, 0.0, 0.4, 0.1)}));
  }
  return scored(truth, results);
}

TEST(Score, KeptIdentitiesAreWorthOne) {
  const Score score = two_tubes([](std::int64_t) { return std::pair(5, 6); });
  EXPECT_EQ(score.total.idf1(), 1.0);
  EXPECT_EQ(score.total.switches + score.total.transfers, 0);
}

TEST(Score, SwappedIdentitiesAreSwitchesBothWays) {
  const Score score = two_tubes([](std::int64_t f) { return f < 7 ? std::pair(5, 6) : std::pair(6, 5); });
  EXPECT_EQ(score.total.switches, 2);
  EXPECT_EQ(score.total.transfers, 2);
  EXPECT_THAT(score.total.idf1(), DoubleNear(2.0 * 14 / (20 + 20), 1e-12));
  ASSERT_EQ(score.tubes.size(), 2U);
  EXPECT_EQ(score.tubes[0].switches, 1);
  EXPECT_THAT(score.tubes[0].idf1(), DoubleNear(2.0 * 7 / (10 + 10), 1e-12));
}

TEST(Score, ANewIdentityIsOneSwitchAndNoTransfer) {
  const Score score = two_tubes([](std::int64_t f) { return std::pair(f < 4 ? 5 : 7, 6); });
  EXPECT_EQ(score.total.switches, 1);
  EXPECT_EQ(score.total.transfers, 0);
  EXPECT_THAT(score.total.idf1(), DoubleNear(2.0 * 16 / (20 + 20), 1e-12));
}

TEST(Score, ATubeInPiecesIsFoundOnceAndThePiecesCostIdentity) {
  const Score score = scored({truth_frame(0, {true_tube(1, 0.0)})},
                             {result_frame(0, {reported_tube(9, 0.0, 0.25, 0.0), reported_tube(10, 0.25, 0.4, 0.0)})});
  EXPECT_EQ(score.total.coverage(), 1.0);
  EXPECT_EQ(score.total.frames_found, 1);
  EXPECT_THAT(score.total.idf1(), DoubleNear(2.0 * 1 / (1 + 2), 1e-12));
}

TEST(Score, ATubeHardlyInViewNeedNotBeFound) {
  TrueTube truth = true_tube(1, 0.0);
  truth.visible.assign(truth.centerline_m.size(), false);
  for (std::size_t i = 0; i < 9; ++i) truth.visible[i] = true;
  const Score score = scored({truth_frame(0, {truth})}, {result_frame(0, {})});
  EXPECT_EQ(score.total.frames_in_view, 0);
  EXPECT_EQ(score.total.coverage(), 0.0);
}

TEST(Score, BadMissingAndEarlyFramesAreCountedNotScored) {
  std::vector<TruthFrame> truth;
  std::vector<TubeFrame> results;
  for (std::int64_t f = 0; f < 6; ++f) {
    truth.push_back(truth_frame(f, {true_tube(1, 0.0)}));
    if (f != 3) results.push_back(result_frame(f, {reported_tube(9, 0.0, 0.4, 0.0)}));
  }
  results[2] = result_frame(2, {});
  results[2].status = TrackStatus::corrupt;
  results.push_back(result_frame(77, {}));
  const Score score = scored(truth, results, {.first_frame = 1});
  EXPECT_EQ(score.frames_scored, 3);
  EXPECT_EQ(score.frames_bad, 1);
  EXPECT_EQ(score.frames_not_run, 1);
  EXPECT_EQ(score.frames_without_truth, 1);
  EXPECT_EQ(score.total.coverage(), 1.0);
}

TEST(Score, RunsThatCannotBeComparedAreRefused) {
  const std::vector<TruthFrame> truth = {truth_frame(0, {true_tube(1, 0.0)})};
  EXPECT_THAT(score_run(truth, std::vector{result_frame(5, {})}, {}).error().message, HasSubstr("no frame to score"));
  std::vector<TubeFrame> results = {result_frame(0, {reported_tube(9, 0.0, 0.4, 0.0)})};
  results[0].frame_id = "world";
  EXPECT_THAT(score_run(truth, results, {}).error().message, HasSubstr("camera frame, the result in the world frame"));
}

TEST(Score, TableAndJsonSayTheSame) {
  const Score score = scored_one(reported_tube(9, 0.0, 0.4, 0.003));
  EXPECT_THAT(score_table(score),
              HasSubstr("100.00   3.000           0.00            0.00             -  1.000         0          0"));
  const auto json = nlohmann::json::parse(score_json(score));
  EXPECT_EQ(json["total"]["coverage"], 1.0);
  EXPECT_EQ(json["total"]["rms_m"], 0.003);
  EXPECT_EQ(json["tubes"][0]["id"], 1);
  EXPECT_TRUE(json["total"]["inside_95"].is_null());
  EXPECT_TRUE(nlohmann::json::parse(score_json(scored({truth_frame(0, {})}, {result_frame(0, {})})))["total"]["rms_m"]
                  .is_null());
}

TEST(Score, ResultsOfAnotherSceneAreTakenForWhatTheyAre) {
  const char* const kHint = "are these the results of this recording";
  EXPECT_THAT(score_table(scored_one(reported_tube(9, 0.0, 0.4, 0.5))), HasSubstr(kHint));
  EXPECT_THAT(score_table(scored_one(reported_tube(9, 0.0, 0.4, 0.003))), Not(HasSubstr(kHint)));
}

TEST(Score, BendsAreComparedWhereTubesHaveThem) {
  TrueTube truth = true_tube(1, 0.0);
  truth.bends = {{0.1, 1.2, 0.0}};
  Tube tube = reported_tube(9, 0.0, 0.4, 0.0);
  tube.bend_table.lra.resize(2);
  tube.bend_table.lra[0].angle_rad = 1.21;
  tube.bend_table.lra[0].bend_radius_m = 0.102;
  const Score score = scored({truth_frame(0, {truth})}, {result_frame(0, {tube})});
  EXPECT_THAT(score_table(score), HasSubstr("bends: as many as there are on 1 of 1 tubes; of these angle 0.57° off, "
                                            "bend radius 2.00 %, rotation -° (medians"));
  const auto json = nlohmann::json::parse(score_json(score))["bends"];
  EXPECT_EQ(json["tubes_right"], 1);
  EXPECT_NEAR(json["angle_error_median_rad"].get<double>(), 0.01, 1e-7);
  EXPECT_TRUE(json["rotation_error_median_rad"].is_null());
}

TEST(Score, IntervalsAreCountedWhereCovariancesAreGiven) {
  Tube tube = reported_tube(9, 0.1, 0.3, 0.0004);
  for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) {
    const double sigma_m = i % 4 == 0 ? 0.0001 : 0.0002;  // every fourth node is too sure
    tube.node_covariance_m2.emplace_back(sigma_m * sigma_m * Eigen::Matrix3d::Identity());
  }
  const Score score = scored_one(tube);
  EXPECT_EQ(score.total.interval_nodes, 21);
  EXPECT_EQ(score.total.interval_hits, 15);
  EXPECT_THAT(score.tubes.at(0).inside_95(), DoubleNear(15.0 / 21.0, 1e-12));
}

TEST(FootOnLine, InsideAtACornerAndBeyondTheEnds) {
  const std::vector<Eigen::Vector3d> corner = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}};
  EXPECT_FALSE(foot_on_line({0.5, -0.2, 0}, corner).beyond_end);
  EXPECT_DOUBLE_EQ(foot_on_line({0.5, -0.2, 0}, corner).distance_m, 0.2);
  EXPECT_FALSE(foot_on_line({1.3, -0.4, 0}, corner).beyond_end);  // the corner is no end
  EXPECT_DOUBLE_EQ(foot_on_line({1.3, -0.4, 0}, corner).distance_m, 0.5);
  EXPECT_TRUE(foot_on_line({-0.3, 0.4, 0}, corner).beyond_end);
  const LineFoot foot = foot_on_line({1.2, 0.25, 0}, corner);
  EXPECT_EQ(foot.point_m, Eigen::Vector3d(1, 0.25, 0));
  EXPECT_EQ(foot.along, Eigen::Vector3d::UnitY());
  EXPECT_DOUBLE_EQ(foot.from_start_m, 1.25);
  EXPECT_TRUE(foot_on_line({1, 1.5, 0}, corner).beyond_end);
  EXPECT_TRUE(std::isinf(foot_on_line({0, 0, 0}, {}).distance_m));
}

TEST(Resample, PiecesAreEqualAndAddUpToTheLength) {
  const std::vector<Eigen::Vector3d> line = {{0, 0, 0}, {0.0031, 0, 0}, {0.0031, 0.0031, 0}, {0.0031, 0.0031, 0}};
  const LineSamples samples = resample(line, 0.002);
  ASSERT_EQ(samples.points.size(), 4U);
  EXPECT_DOUBLE_EQ(samples.piece_m, 0.0062 / 4);
  EXPECT_NEAR(samples.points[3].y(), 0.0062 * 7 / 8 - 0.0031, 1e-12);
  EXPECT_TRUE(resample({}, 0.002).points.empty());
  EXPECT_TRUE(resample(std::vector<Eigen::Vector3d>{{1, 1, 1}}, 0.002).points.empty());
}

TEST(BestAssignment, BeatsTheGreedyChoice) {
  // Greedy takes 10 and is left with 0: 10. The best is 9 + 8.
  EXPECT_EQ(best_assignment({10, 9, 8, 0}, 2, 2), (std::vector<int>{1, 0}));
  EXPECT_EQ(best_assignment({0, 5, 0, 0, 0, 0}, 2, 3), (std::vector<int>{1, -1}));
  EXPECT_EQ(best_assignment({1, 2, 3}, 3, 1), (std::vector<int>{-1, -1, 0}));
  EXPECT_EQ(best_assignment({}, 0, 0), std::vector<int>{});
  EXPECT_EQ(best_assignment({}, 2, 0), (std::vector<int>{-1, -1}));
}

}  // namespace
}  // namespace tubetrack
