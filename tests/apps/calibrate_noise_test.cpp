#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/program.hpp"
#include "replay/recording_files.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// Two slanted walls that meet, 0.6 to 3 m away; small, to be quick.
constexpr const char* kStillScene = R"({"camera": {"width": 320, "height": 240, "fx_px": 285}, "frames": 12, "solids": [
  {"type": "plane", "point_m": [0, 0, 1.6], "normal": [-0.9, 0.1, -0.6]},
  {"type": "plane", "point_m": [0, 0, 3.0], "normal": [0.4, -0.2, -1]}]})";

class CalibrateNoiseCommand : public testing::Test {
 protected:
  ProgramEnd run(std::vector<std::string> arguments) { return Program(output_.path(), std::move(arguments)).wait(); }
  ProgramEnd calibrate(std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), {"calibrate-noise", path()});
    return run(std::move(flags));
  }
  void make_still_recording() {
    write_text(output_ / "still.json", kStillScene);
    ASSERT_EQ(run({"synth", (output_ / "still.json").string(), path()}).exit_code, 0);
  }
  void expect_refused(const ProgramEnd& end, int exit_code, const std::string& words) {
    EXPECT_EQ(end.exit_code, exit_code) << end.err;
    EXPECT_THAT(end.out, IsEmpty());
    EXPECT_EQ(end.error_lines().size(), 1U) << end.err;
    EXPECT_THAT(end.err, HasSubstr(words));
  }
  std::string path() const { return (recording_ / "r").string(); }

  TemporaryFolder recording_, output_;
};

TEST_F(CalibrateNoiseCommand, WritesAModelThatNoiseReadsAndATable) {
  make_still_recording();
  const std::string file = (output_ / "mine.json").string();
  const ProgramEnd end = calibrate({"--out", file});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, IsEmpty());
  EXPECT_THAT(end.err, AllOf(HasSubstr("measured sigma mm"), HasSubstr("ratio")));
  const auto model = read_noise_model(file);
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_EQ(model->name, "mine");
  for (const double z : {1.0, 2.0}) {
    EXPECT_NEAR(axial_sigma_m(*model, z, 0.3), axial_sigma_m({}, z, 0.3), 0.08 * axial_sigma_m({}, z, 0.3)) << z;
  }
  const ProgramEnd config = run({"replay", "--noise", file, "--print-config"});
  ASSERT_EQ(config.exit_code, 0) << config.err;
  const auto noise = nlohmann::json::parse(config.out)["noise"];
  EXPECT_EQ(noise["name"], "mine");
  EXPECT_EQ(noise["axial_constant_m"], model->axial_constant_m);
}

TEST_F(CalibrateNoiseCommand, WithoutOutTheModelGoesToStdoutAndQuietLeavesStderrEmpty) {
  make_still_recording();
  const ProgramEnd end = calibrate({"--quiet", "--frames", "0:10"});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.err, IsEmpty());
  EXPECT_EQ(nlohmann::json::parse(end.out)["name"], "calibrated");
}

TEST_F(CalibrateNoiseCommand, WhatCannotBeCalibratedIsRefusedInOneLine) {
  make_still_recording();
  expect_refused(calibrate({"--frames", "0:9"}), 1, "/r: 9 good frame(s), takes at least 10");
  expect_refused(calibrate({"--out", "/nowhere/a.json"}), 2, "--out /nowhere/a.json: No such file");
  expect_refused(calibrate({"--noise", "kinect9"}), 2,
                 "--noise kinect9: takes kinect1, stereo, tof, synthetic or a JSON file");
  expect_refused(calibrate({"--frames", "9:3"}), 2, "--frames 9:3: takes A:B");
  expect_refused(run({"calibrate-noise"}), 2, "RECORDING");
  expect_refused(run({"calibrate-noise", "/nowhere"}), 2, "/nowhere");
}

TEST_F(CalibrateNoiseCommand, AMovingCameraIsRefusedWithTheShareThatChanged) {
  ASSERT_EQ(run({"synth", "moving-camera", path(), "--frames", "12"}).exit_code, 0);
  expect_refused(calibrate(), 1, "% of the pixels ");
}

TEST_F(CalibrateNoiseCommand, ARealHandHeldRecordingIsRefused) {
  if (real_data().empty()) GTEST_SKIP() << "no real recordings here";
  expect_refused(run({"calibrate-noise", (real_data() / "glue-f200-seq50").string()}), 1, "a camera at rest");
}

TEST_F(CalibrateNoiseCommand, ARealStillRecordingHasTheKinectsSteps) {
  if (real_data().empty()) GTEST_SKIP() << "no real recordings here";
  for (int i = 0; i < 12; ++i) {
    const std::string name = "depth_" + std::string(i < 10 ? "0" : "") + std::to_string(i) + ".png";
    std::filesystem::create_directories(path());
    std::filesystem::copy(real_data() / "kinect-oni/derived" / name, path());
  }
  const ProgramEnd end = calibrate({"--intrinsics", "574.7,577.6,319.5,239.5", "--depth-scale", "0.001"});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  const auto model = nlohmann::json::parse(end.out);
  // An eighth of a pixel at the first Kinect's 75 mm and about 577 px, found in the depths alone.
  const double step = model["disparity_step_px"].get<double>() / model["baseline_focal_m_px"].get<double>();
  EXPECT_NEAR(step, 0.125 / (0.075 * 577.0), 0.01 * step);
  EXPECT_THAT(end.err, Not(HasSubstr("cannot be told")));
}

TEST_F(CalibrateNoiseCommand, HelpTeaches) {
  EXPECT_THAT(run({"calibrate-noise", "--help"}).out,
              AllOf(HasSubstr("Examples:"), HasSubstr("--out my-sensor.json"), HasSubstr("still scene")));
}

}  // namespace
}  // namespace tubetrack
