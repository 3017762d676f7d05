#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "apps/program.hpp"
#include "replay/recording_files.hpp"
#include "tubetrack/replay/tube_truth.hpp"
#include "tubetrack/report/result_json.hpp"

namespace tubetrack {
namespace {

using namespace test;
using testing::HasSubstr;

class Eval : public testing::Test {
 protected:
  ProgramEnd run(std::vector<std::string> arguments) { return Program(output_.path(), std::move(arguments)).wait(); }
  void make_recording() {
    ASSERT_EQ(run({"synth", "straight", recording_.path().string(), "--frames", "3"}).exit_code, 0);
  }
  std::string path() const { return recording_.path().string(); }

  TemporaryFolder recording_, output_;
};

/// What a perfect tracker would report.
std::string perfect_lines(const std::filesystem::path& truth_file) {
  const auto truth = read_truth(truth_file);
  EXPECT_TRUE(truth);
  std::string text;
  for (const TruthFrame& frame : *truth) {
    TubeFrame result;
    result.frame = frame.frame;
    result.frame_id = frame.frame_id;
    for (const TrueTube& tube : frame.tubes) {
      Tube& reported = result.tubes.emplace_back();
      reported.id = tube.id + 100;
      reported.radius_m = tube.radius_m;
      reported.centerline_m = tube.centerline_m;
    }
    text += result_line(result, false) + "\n";
  }
  return text;
}

TEST_F(Eval, TheTruthItselfScoresPerfect) {
  make_recording();
  write_text(output_ / "a.jsonl", perfect_lines(recording_ / "truth.jsonl"));
  const ProgramEnd end = run({"eval", path(), (output_ / "a.jsonl").string(), "--json"});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  const auto score = nlohmann::json::parse(end.out);
  EXPECT_EQ(score["frames_scored"], 3);
  EXPECT_EQ(score["total"]["coverage"], 1.0);
  EXPECT_LE(score["total"]["rms_m"], 2e-6);
  EXPECT_EQ(score["total"]["false_length"], 0.0);
  EXPECT_EQ(score["total"]["radius_error_median"], 0.0);
  EXPECT_EQ(score["total"]["idf1"], 1.0);
  const ProgramEnd some = run({"eval", path(), (output_ / "a.jsonl").string(), "--frames", "0:2", "--skip", "1"});
  EXPECT_THAT(some.out, HasSubstr("1 frames scored"));
}

TEST_F(Eval, TrackingNowAndTheLinesOfAReplayScoreTheSame) {
  make_recording();
  const auto file = (output_ / "a.jsonl").string();
  ASSERT_EQ(run({"replay", path(), "--radius", "0.0125", "--out", file}).exit_code, 0);
  const ProgramEnd from_file = run({"eval", path(), file});
  const ProgramEnd now = run({"eval", path(), "--radius", "0.0125"});
  EXPECT_EQ(from_file.exit_code, 0) << from_file.err;
  EXPECT_EQ(from_file.out, now.out);
  EXPECT_THAT(now.out, HasSubstr("coverage %"));
}

TEST_F(Eval, WhatCannotBeScoredIsNamed) {
  const ProgramEnd nowhere = run({"eval", "/nowhere/recording"});
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("/nowhere/recording: no such file or folder"));
  write_tum(recording_.path(), 2);
  const ProgramEnd untrue = run({"eval", path()});
  EXPECT_EQ(untrue.exit_code, 1);
  EXPECT_THAT(untrue.err, HasSubstr("truth.jsonl: not found"));
  write_text(recording_ / "truth.jsonl", "nonsense\n");
  const ProgramEnd nonsense = run({"eval", path()});
  EXPECT_EQ(nonsense.exit_code, 1);
  EXPECT_THAT(nonsense.err, HasSubstr("truth.jsonl"));
}

TEST_F(Eval, FlagsOfReplayAloneAreNotItsOwn) {
  EXPECT_THAT(run({"eval", "--help"}).out, testing::Not(HasSubstr("--map")));
  const ProgramEnd end = run({"eval", path(), "--map", "plane"});
  EXPECT_EQ(end.exit_code, 2);
  EXPECT_EQ(end.err, "tubetrack: --map: is a flag of replay alone; see tubetrack eval --help\n");
}

TEST_F(Eval, ABrokenResultFileIsNamedWithItsLine) {
  make_recording();
  write_text(output_ / "a.jsonl", perfect_lines(recording_ / "truth.jsonl") + "{\"frame\": 3}\n");
  const ProgramEnd end = run({"eval", path(), (output_ / "a.jsonl").string()});
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("a.jsonl, line 4:"));
  EXPECT_THAT(end.err, testing::Not(HasSubstr("json.exception"))) << end.err;
  EXPECT_EQ(run({"eval", path(), "--skip", "few"}).exit_code, 2);
  EXPECT_EQ(run({"eval"}).exit_code, 2);
}

}  // namespace
}  // namespace tubetrack
