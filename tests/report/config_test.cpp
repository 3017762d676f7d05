#include "tubetrack/report/config.hpp"

#include <gmock/gmock.h>

#include "replay/recording_files.hpp"

namespace tubetrack {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string refusal(const std::string& text) {
  const auto config = parse_config(text, "a.json");
  EXPECT_FALSE(config) << text;
  if (config) return "";
  EXPECT_EQ(config.error().kind, Error::Kind::usage);
  EXPECT_THAT(config.error().message, testing::StartsWith("a.json: "));
  EXPECT_EQ(config.error().message.find('\n'), std::string::npos);
  return config.error().message;
}

TEST(Config, WhatTheFileDoesNotNameKeepsItsDefault) {
  const auto config = parse_config(R"({"radius_m": 0.02, "threads": 2, "noise": {"lateral_px": 0.25}})", "a.json");
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->radius_m, 0.02);
  EXPECT_EQ(config->threads, 2);
  EXPECT_EQ(config->noise.lateral_px, 0.25);
  TrackerConfig expected;
  expected.radius_m = 0.02;
  expected.threads = 2;
  expected.noise.lateral_px = 0.25;
  EXPECT_EQ(config_text(*config), config_text(expected));
  EXPECT_EQ(config_text(*parse_config("{}", "a.json")), config_text(TrackerConfig{}));
}

TEST(Config, WrittenAndReadAgainIsTheSame) {
  TrackerConfig config;
  config.radius_m = 0.0123;
  config.roi_width_px = 320;
  config.roi_height_px = 200;
  config.noise = *noise_model_by_name("tof");
  const auto again = parse_config(config_text(config), "a.json");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(config_text(*again), config_text(config));
  EXPECT_EQ(again->radius_m, 0.0123);
  EXPECT_EQ(again->noise.name, "tof");
}

TEST(Config, AVaryingRadiusIsReadAndRefusedBesideAKnownRadius) {
  const auto config = parse_config(R"({"varying_radius": true})", "a.json");
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_TRUE(config->varying_radius);
  EXPECT_TRUE(parse_config(config_text(*config), "a.json")->varying_radius);
  EXPECT_THAT(refusal(R"({"varying_radius": 1})"), HasSubstr("varying_radius: got 1, takes true or false"));
  EXPECT_THAT(refusal(R"({"varying_radius": true, "radius_m": 0.02})"), HasSubstr("varying_radius: got true"));
}

TEST(Config, AnUnknownKeyIsRefusedWithTheNearestAndAllKnown) {
  EXPECT_THAT(refusal(R"({"radius": 0.02})"),
              AllOf(HasSubstr("radius: unknown key, did you mean radius_m?"), HasSubstr("depth_min_m, depth_max_m")));
  EXPECT_THAT(refusal(R"({"noise": {"latteral_px": 1}})"),
              HasSubstr("noise.latteral_px: unknown key, did you mean lateral_px?"));
  EXPECT_THAT(refusal(R"({"colour": 1})"), HasSubstr("colour: unknown key; known are radius_min_m"));
}

TEST(Config, AWrongTypeNamesKeyValueAndWhatItTakes) {
  EXPECT_THAT(refusal(R"({"cell_m": "small"})"), HasSubstr("cell_m: got \"small\", takes a number"));
  EXPECT_THAT(refusal(R"({"threads": 1.5})"), HasSubstr("threads: got 1.5, takes a whole number"));
  EXPECT_THAT(refusal(R"({"noise": 3})"), HasSubstr("noise: got 3, takes a name or an object"));
  EXPECT_THAT(refusal(R"({"noise": "kinect9"})"), AllOf(HasSubstr("noise"), HasSubstr("kinect9"), HasSubstr("stereo")));
  EXPECT_THAT(refusal(R"({"noise": {"lateral_px": -1}})"), HasSubstr("noise.lateral_px: got -1, takes pixels, 0 to"));
  EXPECT_THAT(refusal("[1]"), HasSubstr("one JSON object"));
  EXPECT_THAT(refusal("{\"cell_m\": }"), HasSubstr("no JSON"));
}

TEST(Config, AValueOutOfRangeIsRefused) {
  EXPECT_THAT(refusal(R"({"radius_m": -0.02})"), HasSubstr("radius_m: got -0.02"));
  EXPECT_THAT(refusal(R"({"radius_min_m": 0.2})"), HasSubstr("radius_max_m: got 0.1"));
}

TEST(Config, AMissingFileIsNamed) {
  const auto config = read_config("/nowhere/config.json");
  ASSERT_FALSE(config);
  EXPECT_THAT(config.error().message, HasSubstr("/nowhere/config.json: cannot be read"));
}

TEST(Config, WhatTheFileDoesNotNameIsThatOfTheDefaultsGiven) {
  TrackerConfig defaults;
  defaults.noise = *noise_model_by_name("stereo");
  const auto config = parse_config(R"({"threads": 2, "noise": {"lateral_px": 0.25}})", "a.json", defaults);
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->noise.name, "stereo");
  EXPECT_EQ(config->noise.lateral_px, 0.25);
  EXPECT_EQ(config->noise.baseline_focal_m_px, defaults.noise.baseline_focal_m_px);
}

class NoiseModelFile : public testing::Test {
 protected:
  Expected<NoiseModel> read(const std::string& text) {
    test::write_text(folder_ / "mine.json", text);
    return read_noise_model(folder_ / "mine.json");
  }
  std::string refusal(const std::string& text) {
    const auto model = read(text);
    EXPECT_FALSE(model) << text;
    EXPECT_EQ(model.error().kind, Error::Kind::usage);
    EXPECT_THAT(model.error().message, HasSubstr("mine.json: "));
    return model.error().message;
  }
  test::TemporaryFolder folder_;
};

TEST_F(NoiseModelFile, WhatItDoesNotNameIsKinect1s) {
  const auto model = read(R"({"axial_constant_m": 0.002})");
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_EQ(model->name, "mine");
  EXPECT_EQ(model->axial_constant_m, 0.002);
  EXPECT_EQ(model->lateral_px, NoiseModel{}.lateral_px);
  EXPECT_EQ(read(R"({"name": "other"})")->name, "other");
}

TEST_F(NoiseModelFile, WrittenAndReadAgainIsTheSame) {
  for (NoiseModel model : built_in_noise_models()) {
    model.depth_step_m = 0.001;
    model.axial_grazing = 1.0 / 3.0;
    const auto again = read(noise_model_text(model));
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(noise_model_text(*again), noise_model_text(model));
    EXPECT_EQ(again->axial_grazing, model.axial_grazing);
  }
}

TEST_F(NoiseModelFile, RefusesWithFieldWhatItGotAndWhatItTakes) {
  EXPECT_THAT(refusal(R"({"sigma": 1})"), HasSubstr("json: sigma: unknown key; known are name, axial_constant_m"));
  EXPECT_THAT(refusal(R"({"axial_constant": 0.001})"), HasSubstr("did you mean axial_constant_m?"));
  EXPECT_THAT(refusal(R"({"lateral_px": "half"})"), HasSubstr("json: lateral_px: got \"half\", takes a number"));
  EXPECT_THAT(refusal(R"({"axial_constant_m": 1.2})"), HasSubstr("axial_constant_m: got 1.2, takes metres, 0 to 1"));
  EXPECT_THAT(refusal(R"({"disparity_step_px": -0.125})"), HasSubstr("disparity_step_px: got -0.125, takes pixels"));
  EXPECT_THAT(refusal(R"({"baseline_focal_m_px": 0})"), HasSubstr("baseline_focal_m_px: got 0, takes metres × pixels"));
  EXPECT_THAT(refusal(R"({"axial_constant_m": 0, "disparity_step_px": 0})"), HasSubstr("more than 0 metres"));
  EXPECT_THAT(refusal(R"("kinect1")"), HasSubstr("takes one JSON object"));
  EXPECT_THAT(refusal("{"), HasSubstr("is no JSON: parse error at line 1, column 2"));
}

}  // namespace
}  // namespace tubetrack
