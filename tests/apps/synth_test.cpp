#include <gmock/gmock.h>

#include <filesystem>

#include "apps/program.hpp"
#include "replay/recording_files.hpp"
#include "tubetrack/replay/synthetic_scene.hpp"
#include "tubetrack/report/config.hpp"

namespace tubetrack {
namespace {

using namespace test;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Synth : public testing::Test {
 protected:
  ProgramEnd run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "synth");
    return Program(output_.path(), std::move(arguments)).wait();
  }
  /// The one line of a refusal.
  std::string refusal(std::vector<std::string> arguments, int exit_code = 2) {
    const ProgramEnd end = run(std::move(arguments));
    EXPECT_EQ(end.exit_code, exit_code) << end.err;
    EXPECT_THAT(end.out, IsEmpty());
    EXPECT_EQ(end.error_lines().size(), 1U) << end.err;
    return end.err;
  }
  std::string path() const { return (recording_ / "r").string(); }

  TemporaryFolder recording_, output_;
};

TEST_F(Synth, ListsThePresetsOneALine) {
  const ProgramEnd end = run({"--list"});
  EXPECT_EQ(end.exit_code, 0);
  EXPECT_EQ(end.out_lines(), std::vector<std::string>(preset_names().begin(), preset_names().end()));
}

TEST_F(Synth, WritesAsManyFramesAsAskedForAndSaysSoInOneLine) {
  const ProgramEnd end = run({"near-thin", path(), "--frames", "2", "--seed", "9"});
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out_lines(), ElementsAre(HasSubstr(": near-thin, 640 x 480 pixels, frames 2, tubes 1, seed 9")));
  EXPECT_EQ(lines_of(read_text(path() + "/truth.jsonl")).size(), 2U);
  EXPECT_TRUE(std::filesystem::exists(path() + "/depth/000001.png"));
  EXPECT_FALSE(std::filesystem::exists(path() + "/depth/000002.png"));
}

TEST_F(Synth, TheRecordingBringsItsNoiseModel) {
  ASSERT_EQ(run({"straight", path(), "--frames", "1"}).exit_code, 0);
  const auto model = read_noise_model(path() + "/noise.json");
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_EQ(model->name, "synthetic");
  EXPECT_EQ(model->radius_relative, 0.0);
}

TEST_F(Synth, WithoutNoiseUnitsAreATenthOfAMillimetreUnlessAskedOtherwise) {
  ASSERT_EQ(run({"straight", path(), "--frames", "1", "--no-noise"}).exit_code, 0);
  EXPECT_THAT(read_text(path() + "/camera_info.yaml"), HasSubstr("depth_scale: 0.0001 "));
  ASSERT_EQ(run({"straight", path(), "--frames", "1", "--no-noise", "--depth-scale", "0.0002"}).exit_code, 0);
  EXPECT_THAT(read_text(path() + "/camera_info.yaml"), HasSubstr("depth_scale: 0.0002 "));
}

TEST_F(Synth, EveryPartOfTheNoiseHasItsSwitch) {
  ASSERT_EQ(run({"straight", path(), "--frames", "1"}).exit_code, 0);
  const std::string noisy = read_text(path() + "/depth/000000.png");
  for (const char* off :
       {"--no-axial", "--no-jitter", "--no-quantisation", "--no-dropout", "--no-mixed", "--no-shadow"}) {
    ASSERT_EQ(run({"straight", path(), "--frames", "1", off}).exit_code, 0) << off;
    EXPECT_NE(read_text(path() + "/depth/000000.png"), noisy) << off;
  }
  ASSERT_EQ(run({"straight", path(), "--frames", "1"}).exit_code, 0);
  EXPECT_EQ(read_text(path() + "/depth/000000.png"), noisy);
}

TEST_F(Synth, WhatCannotBeRenderedIsRefusedInOneLine) {
  EXPECT_THAT(refusal({}), HasSubstr("SCENE or PATH is missing"));
  EXPECT_THAT(refusal({"stright", path()}), HasSubstr("got 'stright', takes a .json file or one of straight, bent"));
  EXPECT_THAT(refusal({"straight", path(), "--frames", "0"}), HasSubstr("--frames: got 0, takes 1 to 1000000"));
  EXPECT_THAT(refusal({"straight", path(), "--depth-scale", "-1"}), HasSubstr("--depth-scale: got -1, takes"));
  EXPECT_THAT(refusal({"straight", path(), "--depth-scale", "nan"}), HasSubstr("--depth-scale: got nan, takes"));
  EXPECT_THAT(refusal({"straight", path(), "--seed", "x"}), HasSubstr("--seed x: takes a whole number, 0 or above"));
  EXPECT_THAT(refusal({"straight", path(), "--seed", "-3"}), HasSubstr("--seed -3: takes a whole number, 0 or above"));
  write_text(recording_ / "scene.json", R"({"tubs": []})");
  EXPECT_THAT(refusal({(recording_ / "scene.json").string(), path()}), HasSubstr("scene.json: tubs: unknown key"));
  write_text(recording_ / "scene.json", "{\"tubes\": x}");
  EXPECT_THAT(refusal({(recording_ / "scene.json").string(), path()}), HasSubstr("scene.json: parse error at line 1"));
  write_text(recording_ / "mine/letter.txt", "dear");
  EXPECT_THAT(refusal({"straight", (recording_ / "mine").string()}), HasSubstr("is not empty"));
  EXPECT_FALSE(std::filesystem::exists(path()));
}

}  // namespace
}  // namespace tubetrack
