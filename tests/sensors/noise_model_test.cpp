#include "tubetrack/sensors/noise_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tubetrack/sensors/disparity_levels.hpp"

namespace tubetrack {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

NoiseModel without_rounding() {
  NoiseModel model;
  model.disparity_step_px = 0.0;
  return model;
}

TEST(NoiseModel, AxialSigmaIsThePinnedFormula) {
  // σ_z = 0.0012 + 0.0019 (z − 0.4)² + 0.0001/√z · θ²/(π/2 − θ)²
  const NoiseModel model = without_rounding();
  EXPECT_NEAR(axial_sigma_m(model, 0.4, 0.0), 0.0012, 1e-15);
  EXPECT_NEAR(axial_sigma_m(model, 1.4, 0.0), 0.0031, 1e-15);
  // At 45° θ and π/2 − θ are equal.
  EXPECT_NEAR(axial_sigma_m(model, 1.0, 45.0 * kDegree), 0.0012 + 0.0019 * 0.36 + 0.0001, 1e-12);
  EXPECT_NEAR(axial_sigma_m(model, 0.25, 45.0 * kDegree), 0.0012 + 0.0019 * 0.0225 + 0.0002, 1e-12);
}

TEST(NoiseModel, RoundingOfTheDisparityAddsItsUniformSigma) {
  // At 0.8 m one step of 1/8 px is 0.64 / 42.75 / 8 m of depth.
  const double rounding = 0.64 / 42.75 / 8.0 / std::sqrt(12.0);
  const double gauss = 0.0012 + 0.0019 * 0.16;
  EXPECT_NEAR(axial_sigma_m(NoiseModel{}, 0.8, 0.0), std::hypot(gauss, rounding), 1e-12);
}

TEST(NoiseModel, LateralJitterGrowsWithTheTangent) {
  const NoiseModel model = without_rounding();
  EXPECT_DOUBLE_EQ(depth_sigma_m(model, 0.8, 0.0, 570.0), axial_sigma_m(model, 0.8, 0.0));
  const double lateral = 0.5 * 0.8 / 570.0;  // tan 45° = 1
  EXPECT_NEAR(depth_sigma_m(model, 0.8, 45.0 * kDegree, 570.0),
              std::hypot(axial_sigma_m(model, 0.8, 45.0 * kDegree), lateral), 1e-12);
}

TEST(NoiseModel, IncidenceIsHeldAt85DegreesSoThatSigmaStaysFinite) {
  const NoiseModel model;
  const double limit = depth_sigma_m(model, 1.0, 85.0 * kDegree, 570.0);
  EXPECT_TRUE(std::isfinite(limit));
  EXPECT_DOUBLE_EQ(depth_sigma_m(model, 1.0, 90.0 * kDegree, 570.0), limit);
  EXPECT_DOUBLE_EQ(axial_sigma_m(model, 1.0, 120.0 * kDegree), axial_sigma_m(model, 1.0, 85.0 * kDegree));
}

TEST(NoiseModel, EverySensorGrowsNoisierWithDepthAndIncidence) {
  for (const char* name : {"kinect1", "stereo", "tof"}) {
    const auto model = noise_model_by_name(name);
    ASSERT_TRUE(model) << name;
    EXPECT_EQ(model->name, name);
    for (double z = 0.6; z < 6.0; z += 0.1) {
      EXPECT_LT(depth_sigma_m(*model, z, 0.3, 570.0), depth_sigma_m(*model, z + 0.1, 0.3, 570.0)) << name << " " << z;
      EXPECT_LT(depth_sigma_m(*model, z, 0.3, 570.0), depth_sigma_m(*model, z, 0.4, 570.0)) << name << " " << z;
    }
  }
}

TEST(NoiseModel, RoundingOfTheDepthAddsItsUniformSigma) {
  NoiseModel model = without_rounding();
  model.depth_step_m = 0.006;
  EXPECT_NEAR(axial_sigma_m(model, 0.4, 0.0), std::hypot(0.0012, 0.006 / std::sqrt(12.0)), 1e-12);
}

TEST(NoiseModel, ValidateNamesTheFieldWhatItGotAndWhatItTakes) {
  for (const NoiseModel& model : built_in_noise_models()) EXPECT_TRUE(validate(model)) << model.name;
  NoiseModel model;
  model.axial_quadratic_per_m = -0.5;
  EXPECT_EQ(validate(model).error().message, "axial_quadratic_per_m: got -0.5, takes 1/metres, 0 to 1");
  model = {};
  model.axial_reference_m = std::nan("");
  EXPECT_EQ(validate(model).error().message, "axial_reference_m: got nan, takes metres, 0 to 100");
  model = {};
  model.radius_relative = 0.6;
  EXPECT_EQ(validate(model).error().message, "radius_relative: got 0.6, takes part of the radius, 0 to 0.5");
  model = without_rounding();
  model.axial_constant_m = 0.0;
  ASSERT_FALSE(validate(model)) << "σ may be 0";
  model.depth_step_m = 0.001;
  EXPECT_TRUE(validate(model));
}

TEST(NoiseModel, KnownDevicesHaveTheirs) {
  EXPECT_EQ(noise_model_of_device("PrimeSense PS1080")->name, "kinect1");
  EXPECT_EQ(noise_model_of_device("ASUS Xtion Pro")->name, "kinect1");
  EXPECT_EQ(noise_model_of_device("Intel Intel RealSense D435")->name, "stereo");
  EXPECT_FALSE(noise_model_of_device("Microsoft Kinect")) << "two sensors of that name";
  EXPECT_FALSE(noise_model_of_device("tubetrack virtual depth camera"));
  EXPECT_FALSE(noise_model_of_device(""));
}

TEST(NoiseModel, AReadingRoundedToMillimetresGoesBackToItsDisparityLevel) {
  const NoiseModel model;
  const auto of_level = [&](int level) { return model.baseline_focal_m_px / (level * model.disparity_step_px); };
  const auto written = [](double depth_m) { return std::round(depth_m * 1000.0) / 1000.0; };
  // Up to here levels lie farther apart than millimetres.
  for (int level = 130; level < 584; ++level) {
    EXPECT_NEAR(depth_of_level_m(disparity_levels(model, 1e-6), of_level(level)), of_level(level), 1e-12);
    EXPECT_NEAR(depth_of_level_m(disparity_levels(model, 0.001), written(of_level(level))), of_level(level), 1e-12)
        << level;
  }
  EXPECT_EQ(depth_of_level_m(disparity_levels(model, 0.001), 0.0), 0.0);
  NoiseModel without = model;
  without.disparity_step_px = 0.0;
  EXPECT_EQ(depth_of_level_m(disparity_levels(without, 0.001), 0.8123), 0.8123);
}

TEST(NoiseModel, LevelsWrittenAlikeGiveTheirMean) {
  const NoiseModel model;
  const double per_level = model.baseline_focal_m_px / model.disparity_step_px;
  int several = 0;
  for (int millimetre = 350; millimetre < 600; ++millimetre) {
    double sum_m = 0.0;
    int count = 0;
    for (int level = 500; level < 1100; ++level) {
      if (std::lround(1000.0 * per_level / level) != millimetre) continue;
      sum_m += per_level / level;
      ++count;
    }
    if (count == 0) continue;
    several += count > 1 ? 1 : 0;
    EXPECT_NEAR(depth_of_level_m(disparity_levels(model, 0.001), 0.001F * static_cast<float>(millimetre)),
                sum_m / count, 2e-6)
        << millimetre << ", " << count << " levels";
  }
  EXPECT_GT(several, 130);
}

TEST(NoiseModel, AnUnknownNameIsRefusedWithTheKnownOnes) {
  const auto model = noise_model_by_name("kinect9");
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().kind, Error::Kind::usage);
  EXPECT_EQ(model.error().message, "--noise: got 'kinect9', takes kinect1, stereo, tof, synthetic or a JSON file");
}

}  // namespace
}  // namespace tubetrack
