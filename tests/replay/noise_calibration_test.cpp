#include "tubetrack/replay/noise_calibration.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tubetrack/replay/render.hpp"

namespace tubetrack {
namespace {

using testing::Each;
using testing::HasSubstr;
using testing::Not;

/// A board that fills a good part of one of 4 × 3 fields of the image, seen at this incidence in its middle, turned
/// about its upright or its level axis.
Solid board(int field, double depth_m, double incidence_deg) {
  const double angle = incidence_deg * std::numbers::pi / 180.0;
  const bool level = field % 2 == 1;
  const double across_m = 0.22 * depth_m;
  const double along_m = std::min(across_m / std::cos(angle), depth_m);
  const Eigen::Vector3d ray(-0.42 + 0.28 * (field % 4), -0.28 + 0.28 * (field / 4), 1.0);
  BoxShape box;
  box.center_m = depth_m * ray;
  box.size_m = level ? Eigen::Vector3d(across_m, along_m, 0.002) : Eigen::Vector3d(along_m, across_m, 0.002);
  box.rotation = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ray) *
                 Eigen::AngleAxisd(angle, level ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY());
  return {box, {}};
}

/// Boards from 0.5 to 3.3 m, seen almost straight on to grazing, before a wall.
Scene boards() {
  Scene scene;
  scene.camera = {640, 480, 570.0, 570.0, 319.5, 239.5, {}};
  scene.solids = {{PlaneShape{{0.0, 0.0, 4.2}, {0.1, 0.1, -1.0}}, {}}};
  const double depths_m[] = {0.5, 0.7, 0.9, 1.2, 1.5, 1.9, 2.3, 2.8, 3.3, 0.6, 0.8, 1.0};
  const double incidences_deg[] = {15, 60, 30, 12, 72, 45, 10, 65, 20, 76, 50, 10};
  for (int field = 0; field < 12; ++field) {
    scene.solids.push_back(board(field, depths_m[field], incidences_deg[field]));
  }
  return scene;
}

/// A wall a little askew: seen straight on, one rounding would stand for all its pixels.
Scene wall_at(double depth_m) {
  Scene scene;
  scene.camera = {320, 240, 285.0, 285.0, 159.5, 119.5, {}};
  scene.solids = {{PlaneShape{{0.0, 0.0, depth_m}, {0.05, 0.1, -1.0}}, {}}};
  return scene;
}

PixelHistory watched(const Scene& scene, int frames, const DepthNoise& noise = {}) {
  PixelHistory history;
  for (int frame = 0; frame < frames; ++frame) {
    const RenderedFrame rendered = render_frame(scene, frame, noise);
    EXPECT_TRUE(add_frame(history, depth_frame(rendered)));
  }
  return history;
}

TEST(RoundedVariance, IsThatOfRoundedNormalsAndItsInverseUndoesIt) {
  std::mt19937_64 random(1);
  for (const double sigma : {0.05, 0.2, 0.35, 0.6, 2.0}) {
    double sum = 0.0;
    constexpr int kPlaces = 4000;
    constexpr int kReadings = 50;
    for (int place = 0; place < kPlaces; ++place) {
      double mean = 0.0;
      double squares = 0.0;
      for (int i = 0; i < kReadings; ++i) {
        const double read = std::round(std::normal_distribution(static_cast<double>(place) / kPlaces, sigma)(random));
        mean += read / kReadings;
        squares += read * read;
      }
      sum += (squares - kReadings * mean * mean) / (kReadings - 1);
    }
    EXPECT_NEAR(rounded_variance(sigma, 1.0), sum / kPlaces, 0.03 * sum / kPlaces) << sigma;
    EXPECT_NEAR(sigma_before_rounding(rounded_variance(sigma, 1.0), 1.0), sigma, 1e-6);
  }
  EXPECT_NEAR(rounded_variance(2.0, 1.0), 4.0 + 1.0 / 12.0, 1e-9);
  EXPECT_EQ(rounded_variance(0.3, 0.0), 0.09);
  EXPECT_EQ(sigma_before_rounding(0.0, 1.0), 0.0);
}

/// σ of the model against the truth, before rounding.
void expect_same_sigma(const NoiseModel& found, const NoiseModel& truth, double incidence_rad, double part) {
  for (double z = 0.5; z <= 4.0; z += 0.25) {
    const double want = depth_sigma_m(truth, z, incidence_rad, 570.0);
    EXPECT_NEAR(depth_sigma_m(found, z, incidence_rad, 570.0), want, part * want) << z << " m, " << incidence_rad;
  }
}

NoiseModel truth_in_millimetres() {
  NoiseModel truth;
  truth.depth_step_m = 0.001;
  return truth;
}

TEST(CalibrateNoise, FindsThePinnedNoiseInEveryDepthBin) {
  const Scene scene = boards();
  const auto calibration = calibrate_noise(watched(scene, 20), scene.camera, *noise_model_by_name("tof"));
  ASSERT_TRUE(calibration) << calibration.error().message;
  const NoiseModel& model = calibration->model;
  EXPECT_NEAR(model.axial_constant_m, 0.0012, 0.00012);
  EXPECT_NEAR(model.axial_quadratic_per_m, 0.0019, 0.0001);
  EXPECT_NEAR(model.axial_reference_m, 0.4, 0.1);
  EXPECT_NEAR(model.axial_grazing, 0.0001, 0.00003);
  EXPECT_NEAR(model.lateral_px, 0.5, 0.05);
  EXPECT_NEAR(model.disparity_step_px / model.baseline_focal_m_px, 0.125 / 42.75, 0.005 * 0.125 / 42.75);
  EXPECT_EQ(model.depth_step_m, 0.001);
  expect_same_sigma(model, truth_in_millimetres(), 0.0, 0.03);
  expect_same_sigma(model, truth_in_millimetres(), 1.0, 0.05);
  ASSERT_GE(calibration->rows.size(), 12U);
  for (const NoiseTableRow& row : calibration->rows) {
    EXPECT_NEAR(row.measured_m / row.model_m, 1.0, 0.05) << row.depth_from_m << " m, " << row.pixels << " pixels";
  }
  EXPECT_THAT(calibration->notes, Each(Not(HasSubstr("cannot be told"))));
}

TEST(CalibrateNoise, OfANoiseFreeSceneOnlyTheRoundingIsLeft) {
  const Scene scene = boards();
  const auto calibration = calibrate_noise(watched(scene, 10, DepthNoise::none()), scene.camera, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_LT(calibration->model.axial_constant_m, 2e-6);
  EXPECT_LT(calibration->model.axial_quadratic_per_m, 2e-6);
  EXPECT_EQ(calibration->model.disparity_step_px, 0.0);
  EXPECT_EQ(calibration->model.depth_step_m, 0.0001);
  for (const NoiseTableRow& row : calibration->rows) EXPECT_EQ(row.measured_m, 0.0);
}

TEST(CalibrateNoise, AWallAloneLeavesWhatItCannotTellAtTheStart) {
  const Scene scene = wall_at(1.5);
  const NoiseModel start;
  const auto calibration = calibrate_noise(watched(scene, 20), scene.camera, start);
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_EQ(calibration->model.axial_quadratic_per_m, start.axial_quadratic_per_m);
  EXPECT_EQ(calibration->model.axial_reference_m, start.axial_reference_m);
  EXPECT_NEAR(calibration->model.axial_constant_m, start.axial_constant_m, 0.0001);
  for (const char* term : {"axial_quadratic_per_m", "axial_reference_m", "axial_grazing", "lateral_px"}) {
    EXPECT_THAT(calibration->notes, testing::Contains(HasSubstr(std::string(term) + " cannot be told"))) << term;
  }
}

TEST(CalibrateNoise, StepsThatAreFinerThanTheDepthsUnitStayAtTheStart) {
  const Scene scene = wall_at(0.5);
  const NoiseModel start;
  const auto calibration = calibrate_noise(watched(scene, 10), scene.camera, start);
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_DOUBLE_EQ(calibration->model.disparity_step_px, start.disparity_step_px);
  EXPECT_THAT(calibration->notes, testing::Contains(HasSubstr("disparity_step_px cannot be told")));
}

TEST(CalibrateNoise, RefusesWhatMovesAndSaysTheShare) {
  Scene scene = boards();
  for (std::size_t i = 1; i < scene.solids.size(); ++i) scene.solids[i].motion.velocity_m_s = {0.0, 0.0, 0.05};
  const auto moving = calibrate_noise(watched(scene, 12), scene.camera, {});
  ASSERT_FALSE(moving);
  EXPECT_EQ(moving.error().kind, Error::Kind::failed);
  EXPECT_THAT(moving.error().message, testing::MatchesRegex(R"([0-9]+ % of the pixels changed .* in 12 frames.*)"));
}

TEST(CalibrateNoise, AHandInACornerIsLeftOut) {
  Scene scene = wall_at(1.5);
  Motion to_the_right;
  to_the_right.velocity_m_s = {0.3, 0.0, 0.0};
  scene.solids.push_back({CapsuleShape{{-0.5, -0.3, 0.9}, {-0.4, -0.3, 0.9}, 0.04}, to_the_right});
  const auto calibration = calibrate_noise(watched(scene, 20), scene.camera, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_THAT(calibration->notes, testing::Contains(HasSubstr("% of the pixels changed")));
  for (const NoiseTableRow& row : calibration->rows) EXPECT_NEAR(row.measured_m / row.model_m, 1.0, 0.05);
}

TEST(CalibrateNoise, RefusesTooFewFramesAndEmptyImages) {
  const Scene scene = wall_at(1.5);
  EXPECT_THAT(calibrate_noise(watched(scene, 9), scene.camera, {}).error().message,
              HasSubstr("9 good frame(s), takes at least 10"));
  Scene nothing = scene;
  nothing.solids = {{PlaneShape{{0.0, 0.0, -1.0}, {0.0, 0.0, 1.0}}, {}}};  // behind the camera
  EXPECT_THAT(calibrate_noise(watched(nothing, 10), scene.camera, {}).error().message, HasSubstr("only "));
  EXPECT_FALSE(calibrate_noise({}, scene.camera, {}));
}

TEST(RoundingSteps, OfAConvertedUnitAreTheUnitBefore) {
  // Millimetres written in units of 1/5000 m: every count is a multiple of 5.
  PixelHistory history;
  history.metres_per_unit = 0.0002;
  history.levels.assign(65536, 0);
  for (std::size_t mm = 500; mm < 2000; ++mm) history.levels[5 * mm] = 100;
  const RoundingSteps steps = rounding_steps(history, {});
  EXPECT_DOUBLE_EQ(steps.depth_m, 0.001);
  EXPECT_EQ(steps.disparity, RoundingSteps::Disparity::none);
}

TEST(RoundingSteps, OfDisparityAreFoundWhateverItsOffset) {
  for (const double offset : {0.0, 0.4}) {
    PixelHistory history;
    history.levels.assign(65536, 0);
    const double step_per_m = 0.003;
    for (int k = 120; k < 500; ++k) {
      const double z = 1.0 / ((k + offset) * step_per_m);
      history.levels[static_cast<std::size_t>(std::round(z * 1000.0))] += 1000;
    }
    const RoundingSteps steps = rounding_steps(history, {});
    EXPECT_EQ(steps.disparity, RoundingSteps::Disparity::seen);
    EXPECT_NEAR(steps.inverse_depth_per_m, step_per_m, 0.002 * step_per_m) << offset;
    EXPECT_NEAR(steps.at(2.0), std::hypot(0.012, 0.001), 1e-4);
  }
}

TEST(AddFrame, RefusesAnotherSize) {
  PixelHistory history = watched(wall_at(1.0), 1);
  const RenderedFrame other = render_frame(boards(), 0, {});
  const auto added = add_frame(history, depth_frame(other));
  ASSERT_FALSE(added);
  EXPECT_THAT(added.error().message, HasSubstr("size 640 x 480, takes 320 x 240"));
}

}  // namespace
}  // namespace tubetrack
