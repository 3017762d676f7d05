#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <fstream>
#include <thread>

#include "apps/program.hpp"
#include "replay/recording_files.hpp"
#include "report/schema_check.hpp"
#include "tubetrack/report/result_json.hpp"
#include "tubetrack/report/scan_json.hpp"
#include "tubetrack/report/tube_tables.hpp"

namespace tubetrack {
namespace {

using namespace test;
using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::StartsWith;

class Replay : public testing::Test {
 protected:
  ProgramEnd run(std::vector<std::string> arguments) { return Program(output_.path(), std::move(arguments)).wait(); }
  /// `tubetrack replay` on this test's recording.
  ProgramEnd replay(std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), {"replay", recording_.path().string()});
    return run(std::move(flags));
  }
  void expect_refused(const ProgramEnd& end, int exit_code, const std::vector<std::string>& words) {
    EXPECT_EQ(end.exit_code, exit_code) << end.err;
    EXPECT_EQ(end.out, "");
    ASSERT_THAT(end.error_lines(), SizeIs(1)) << end.err;
    EXPECT_THAT(end.error_lines()[0], StartsWith("tubetrack: "));
    for (const std::string& word : words) EXPECT_THAT(end.error_lines()[0], HasSubstr(word));
  }
  std::filesystem::path image(int number) const {
    const auto lines = lines_of(read_text(recording_ / "depth.txt"));
    const std::string& line = lines[lines.size() - 5 + static_cast<std::size_t>(number)];
    return recording_.path() / line.substr(line.find(' ') + 1);
  }
  void make_recording() { write_tum(recording_.path(), 5); }

  TemporaryFolder recording_, output_;
};

TEST_F(Replay, WritesOneLineAFrameToStdoutAndTheSummaryToStderr) {
  make_recording();
  const ProgramEnd end = replay();
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out_lines(), SizeIs(5));
  EXPECT_THAT(end.err, HasSubstr("frames 5, with tubes 0, bad 0, dropped 0\n"));
  EXPECT_THAT(end.err, HasSubstr("latency"));
  EXPECT_EQ(end.err.find('\r'), std::string::npos) << "no bar where stderr is no terminal";
}

TEST_F(Replay, PlaneMapAndAScanOfItsHeightMapGiveTheSameTubes) {
  const std::string scene = recording_.path().string(), image = (output_ / "table.png").string();
  ASSERT_EQ(run({"synth", "moving-camera", scene, "--frames", "12"}).exit_code, 0);
  const ProgramEnd fused = replay({"--map", "plane", "--save-heightmap", image, "--no-timing"});
  ASSERT_EQ(fused.exit_code, 0) << fused.err;
  ASSERT_THAT(fused.out_lines(), SizeIs(1));
  EXPECT_EQ(schema_complaints(fused.out_lines(), output_.path()), "");
  EXPECT_THAT(fused.err, AllOf(HasSubstr("tube 1: radius 1"), HasSubstr("tube 2: radius ")));
  const ProgramEnd scanned = run({"scan", image, "--no-timing"});
  ASSERT_EQ(scanned.exit_code, 0) << scanned.err;
  const auto whole = parse_result_line(fused.out_lines()[0]);
  const auto again = parse_result_line(scanned.out_lines().at(0));
  ASSERT_TRUE(whole && again);
  EXPECT_EQ(whole->frame, 11);
  EXPECT_EQ(whole->frame_id, "world");
  ASSERT_EQ(whole->tubes.size(), 2U);
  ASSERT_EQ(again->tubes.size(), 2U);
  // The longer one is bent. Of the other, which lies aside, 0.42 m are in view.
  EXPECT_NEAR(whole->tubes[0].radius_m, 0.015, 0.006 * 0.015);
  EXPECT_NEAR(whole->tubes[1].radius_m, 0.020, 0.006 * 0.020);
  EXPECT_NEAR(whole->tubes[0].length_m, 0.46, 0.01);
  EXPECT_GT(whole->tubes[1].length_m, 0.36);
  for (std::size_t i = 0; i < whole->tubes.size(); ++i) {
    EXPECT_NEAR(whole->tubes[i].radius_m, again->tubes[i].radius_m, 1e-6);
    ASSERT_EQ(whole->tubes[i].centerline_m.size(), again->tubes[i].centerline_m.size());
    for (std::size_t k = 0; k < whole->tubes[i].centerline_m.size(); ++k)
      EXPECT_LT((whole->tubes[i].centerline_m[k] - again->tubes[i].centerline_m[k]).norm(), 3e-6);
  }
}

TEST_F(Replay, TubesAreJudgedAgainstNominalOnesInEveryFrameAndAtTheEnd) {
  ASSERT_EQ(run({"synth", "bent", recording_.path().string(), "--frames", "6"}).exit_code, 0);
  const ProgramEnd plain = replay({"--no-timing"});
  const auto last = parse_result_line(plain.out_lines().at(5));
  ASSERT_TRUE(last);
  ASSERT_THAT(last->tubes, SizeIs(1));
  const std::string as_it_is = (output_ / "is.csv").string(), moved = (output_ / "moved.csv").string();
  std::ofstream(as_it_is) << xyz_csv(last->tubes);
  std::vector<Tube> off = last->tubes;
  off[0].bend_table.xyz_m.at(1).x() += 0.005;
  std::ofstream(moved) << xyz_csv(off);

  const ProgramEnd good = replay({"--nominal", as_it_is, "--tolerance", "0.1", "--no-timing"});
  EXPECT_EQ(good.exit_code, 0) << good.err;
  ASSERT_THAT(good.out_lines(), SizeIs(6));
  EXPECT_EQ(schema_complaints(good.out_lines(), output_.path()), "");
  const auto line = parse_scan_line(good.out_lines()[5]);
  ASSERT_TRUE(line && line->nominal.size() == 1U);
  EXPECT_LT(line->nominal[0].max_deviation_m, 1e-5);
  EXPECT_THAT(good.err, HasSubstr("nominal tube 1 on tube 1: RMS 0.00"));
  const auto refuse = [&](std::vector<std::string> flags, int exit_code, const std::vector<std::string>& words) {
    flags.insert(flags.end(), {"--quiet", "--tolerance", "0.5"});
    expect_refused(replay(flags), exit_code, words);
  };
  const std::string out = (output_ / "x.jsonl").string();
  refuse({"--nominal", moved, "--out", out}, 1, {"nominal tube 1 is out of tolerance", "--tolerance 0.5 mm"});
  refuse({"--nominal", moved, "--out", out, "--map", "plane"}, 1, {"nominal tube 1 is out of tolerance"});
  refuse({}, 2, {"--tolerance", "--nominal FILE.csv"});
  refuse({"--nominal", moved, "--out", moved}, 2, {"--out", "is the --nominal file"});
}

TEST_F(Replay, ADeadlineIsAFlagAsWellAsASetting) {
  ASSERT_EQ(run({"synth", "crossing", recording_.path().string(), "--frames", "2"}).exit_code, 0);
  const ProgramEnd shown = replay({"--deadline-ms", "0.01", "--print-config"});
  EXPECT_THAT(shown.out, HasSubstr("\"deadline_ms\": 0.01"));
  const ProgramEnd hurried = replay({"--deadline-ms", "0.01"});
  EXPECT_EQ(hurried.exit_code, 0) << hurried.err;
  EXPECT_THAT(hurried.out, HasSubstr("\"status\":\"deadline\""));
  EXPECT_THAT(hurried.err, HasSubstr("; 0.01 ms a frame (deadline) may be too short"));
}

TEST_F(Replay, ABrokenLineOfTheListIsQuotedInPart) {
  make_recording();
  write_text(recording_ / "depth.txt", std::string(5000, 'q') + "\n");
  const ProgramEnd end = replay();
  expect_refused(end, 1, {"depth.txt:1: got \"qqq", "takes: timestamp filename"});
  EXPECT_LT(end.err.size(), 500U);
}

TEST_F(Replay, PlaneMapOfFramesWithoutAPlaneSaysSo) {
  make_recording();
  expect_refused(replay({"--map", "plane"}), 1, {"--map plane", "no plane"});
}

TEST_F(Replay, ARunWithoutTubesSaysWhatToTry) {
  make_recording();
  EXPECT_THAT(replay().err, HasSubstr("no tube of radius 0.005 to 0.1 m was found"));
  EXPECT_THAT(replay({"--radius", "0.02"}).err, HasSubstr("leave --radius out"));
}

TEST_F(Replay, QuietSaysNothing) {
  make_recording();
  EXPECT_EQ(replay({"--quiet"}).err, "");
}

TEST_F(Replay, OutHoldsWhatStdoutWouldAndOverlaysHaveTheFrameNumbers) {
  make_recording();
  const std::string expected = replay({"--no-timing"}).out;
  const auto file = (output_ / "a.jsonl").string(), folder = (output_ / "pictures/new").string();
  const ProgramEnd end = replay({"--no-timing", "--out", file, "--overlay", folder, "--frames", "2:4"});
  EXPECT_EQ(end.out, "");
  const auto lines = lines_of(expected);
  EXPECT_EQ(read_text(file), lines[2] + "\n" + lines[3] + "\n");
  EXPECT_TRUE(std::filesystem::exists(output_ / "pictures/new/000002.png"));
  EXPECT_TRUE(std::filesystem::exists(output_ / "pictures/new/000003.png"));
  EXPECT_FALSE(std::filesystem::exists(output_ / "pictures/new/000004.png"));
}

TEST_F(Replay, ATruncatedImageIsALineAndTheRunGoesOn) {
  make_recording();
  truncate_to_half(image(2));
  const ProgramEnd end = replay();
  EXPECT_EQ(end.exit_code, 0) << end.err;
  ASSERT_THAT(end.out_lines(), SizeIs(5));
  EXPECT_THAT(end.out_lines()[2],
              AllOf(HasSubstr("\"frame\":2,"), HasSubstr("\"corrupt\""), HasSubstr(image(2).filename().string())));
  EXPECT_THAT(end.err, HasSubstr("bad 1 (1 corrupt)"));
}

TEST_F(Replay, StrictMakesOneBadFrameExit1) {
  make_recording();
  truncate_to_half(image(2));
  const ProgramEnd end = replay({"--strict"});
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.out_lines(), SizeIs(5));
  EXPECT_THAT(end.error_lines().back(), HasSubstr("--strict, and 1 of 5 frames are bad"));
}

TEST_F(Replay, AllFramesBadIsExit1) {
  make_recording();
  write_text(recording_ / "groundtruth.txt", "99.0 0 0 0 0 0 0 1\n100.0 0 0 0 0 0 0 1\n");
  const ProgramEnd end = replay();
  EXPECT_EQ(end.exit_code, 1) << end.err;
  EXPECT_THAT(end.out_lines(), AllOf(SizeIs(5), Each(HasSubstr("\"no_pose\""))));
  EXPECT_THAT(end.error_lines().back(), HasSubstr("all 5 frames are bad"));
}

TEST_F(Replay, TimeGoingBackIsOneCorruptLine) {
  make_recording();
  const auto lines = lines_of(read_text(recording_ / "depth.txt"));
  std::string text;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool spoilt = i + 2 == lines.size();
    text += (spoilt ? "9.5" + lines[i].substr(lines[i].find(' ')) : lines[i]) + "\n";
  }
  write_text(recording_ / "depth.txt", text);
  const ProgramEnd end = replay();
  EXPECT_EQ(end.exit_code, 0) << end.err;
  ASSERT_THAT(end.out_lines(), SizeIs(5));
  EXPECT_THAT(end.out_lines()[3], HasSubstr("\"corrupt\""));
  EXPECT_THAT(end.out_lines()[4], HasSubstr("\"empty\""));
}

TEST_F(Replay, EveryKindOfLineOfTheProgramHoldsAgainstTheSchema) {
  const TemporaryFolder tubes;
  ASSERT_EQ(run({"synth", "straight", tubes.path().string(), "--frames", "2"}).exit_code, 0);
  const ProgramEnd found = run({"replay", tubes.path().string()});
  ASSERT_THAT(found.out, HasSubstr("\"status\":\"ok\"")) << found.err;
  make_recording();
  truncate_to_half(image(1));
  const ProgramEnd plain = replay();
  write_text(recording_ / "groundtruth.txt", "10.2 0 0 0 0 0 0 1\n10.3 0 0 0 0 0 0 1\n");
  const ProgramEnd posed = replay({"--no-timing"});
  const std::string all = found.out + plain.out + posed.out;
  for (const char* status : {"ok", "empty", "corrupt", "no_pose"}) EXPECT_THAT(all, HasSubstr(status));
  EXPECT_EQ(schema_complaints(lines_of(all), output_.path()), "");
}

TEST_F(Replay, ARecordingsOwnNoiseModelIsTheDefaultAndTheFlagWins) {
  const TemporaryFolder tubes;
  ASSERT_EQ(run({"synth", "straight", tubes.path().string(), "--frames", "1"}).exit_code, 0);
  const ProgramEnd own = run({"replay", tubes.path().string()});
  EXPECT_THAT(own.err, HasSubstr("note: noise model synthetic ("));
  const ProgramEnd flag = run({"replay", tubes.path().string(), "--noise", "kinect1"});
  EXPECT_THAT(flag.err, Not(HasSubstr("note: noise model")));
  const auto relative_sigma = [&](const ProgramEnd& end) {
    write_text(output_ / "a.jsonl", end.out);
    const auto results = read_result_lines(output_ / "a.jsonl");
    return results && !results->empty() && !results->front().tubes.empty()
               ? results->front().tubes[0].radius_sigma_m / results->front().tubes[0].radius_m
               : -1.0;
  };
  EXPECT_NEAR(relative_sigma(own), 0.0035, 0.0035);
  EXPECT_NEAR(relative_sigma(flag), std::hypot(0.025, relative_sigma(own)), 2e-4);
  write_text(tubes / "noise.json", "{\"sigma\": 1}");
  const ProgramEnd broken = run({"replay", tubes.path().string()});
  EXPECT_EQ(broken.exit_code, 2);
  EXPECT_THAT(broken.err, AllOf(HasSubstr("noise.json"), HasSubstr("sigma")));
}

TEST_F(Replay, WithoutTimingEqualRunsGiveEqualBytes) {
  const TemporaryFolder tubes;
  ASSERT_EQ(run({"synth", "straight", tubes.path().string(), "--frames", "2"}).exit_code, 0);
  const ProgramEnd one = run({"replay", tubes.path().string(), "--no-timing"});
  const ProgramEnd two = run({"replay", tubes.path().string(), "--no-timing", "--threads", "2"});
  EXPECT_EQ(one.out, two.out);
  EXPECT_THAT(one.out, HasSubstr("\"status\":\"ok\""));
}

TEST_F(Replay, RealtimeLosesNoFrameUncounted) {
  const TemporaryFolder tubes;
  ASSERT_EQ(run({"synth", "straight", tubes.path().string(), "--frames", "10"}).exit_code, 0);
  const ProgramEnd end = run({"replay", tubes.path().string(), "--pace", "realtime"});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  ASSERT_THAT(end.out_lines(), testing::Not(IsEmpty()));
  const auto last = parse_result_line(end.out_lines().back());
  ASSERT_TRUE(last) << last.error().message;
  EXPECT_EQ(last->frame, 9) << "the newest frame is never dropped";
  EXPECT_EQ(static_cast<std::int64_t>(end.out_lines().size()) + last->dropped, 10);
}

class Interrupted : public Replay, public testing::WithParamInterface<int> {};

TEST_P(Interrupted, EndsWithTheLastFullLineWrittenAndTheSummary) {
  write_tum(recording_.path(), 600);  // a minute
  const auto file = output_ / "a.jsonl";
  Program program(output_.path(), {"replay", recording_.path().string(), "--pace", "realtime", "--out", file.string()});
  while (program.running() && lines_of(read_text(file)).size() < 2) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ASSERT_TRUE(program.running());
  program.send(GetParam());
  const ProgramEnd end = program.wait();
  EXPECT_EQ(end.exit_code, 130) << end.err;
  const auto frames = read_result_lines(file);
  ASSERT_TRUE(frames) << frames.error().message;
  EXPECT_GE(frames->size(), 2U);
  EXPECT_LT(frames->size(), 600U);
  EXPECT_TRUE(read_text(file).ends_with("}\n"));
  EXPECT_THAT(end.err, StartsWith("frames " + std::to_string(frames->size()) + ","));
}

INSTANTIATE_TEST_SUITE_P(Signals, Interrupted, testing::Values(SIGINT, SIGTERM));

TEST_F(Replay, AMissingFolderIsNamed) {
  expect_refused(run({"replay", "/nowhere/recording"}), 2, {"/nowhere/recording", "no such file"});
}

TEST_F(Replay, AFolderWithoutFramesIsRefused) {
  expect_refused(replay(), 1, {recording_.path().string(), "no "});
}

TEST_F(Replay, EightBitAndColourImagesAreRefused) {
  const std::vector<std::string> flags = {"--intrinsics", "500,500,8,6", "--depth-scale", "0.001"};
  write_8bit(recording_ / "a.png", 16, 12, 1);
  expect_refused(replay(flags), 1, {"a.png", "8", "16-bit"});
  write_8bit(recording_ / "a.png", 16, 12, 3);
  expect_refused(replay(flags), 1, {"a.png", "3 channel"});
}

TEST_F(Replay, ImagesOfDifferentSizesAreRefused) {
  write_depth(recording_ / "a.png", 16, 12, 1);
  write_depth(recording_ / "b.png", 20, 12, 1);
  expect_refused(replay({"--intrinsics", "500,500,8,6", "--depth-scale", "0.001"}), 1, {"b.png", "20", "16"});
}

TEST_F(Replay, MissingAndContradictoryIntrinsicsAreRefused) {
  write_depth(recording_ / "a.png", 16, 12, 1);
  expect_refused(replay({"--depth-scale", "0.001"}), 2, {"intrinsics", "--intrinsics fx,fy,cx,cy"});
  const TemporaryFolder tum;
  write_tum(tum.path(), 2);
  write_text(tum / "camera_info.yaml", camera_info_text(640, 480));
  expect_refused(run({"replay", tum.path().string()}), 1, {"camera_info.yaml", "640", "16"});
}

TEST_F(Replay, FocalLengthsThatCannotBeAreRefused) {
  make_recording();
  for (const char* fx : {"0.0", "-500", ".nan"}) {
    write_text(recording_ / "camera_info.yaml", camera_info_text(16, 12, fx));
    expect_refused(replay(), 1, {"camera_info.yaml", "fx"});
  }
}

TEST_F(Replay, AnAbsurdDepthScaleIsRefused) {
  make_recording();
  expect_refused(replay({"--depth-scale", "1.0"}), 2, {"--depth-scale", "median"});
}

TEST_F(Replay, ARadiusLargerThanTheSceneIsRefused) {
  make_recording();
  expect_refused(replay({"--radius", "2"}), 2, {"radius 2 m: larger than the scene", "--radius 0.02"});
  expect_refused(replay({"--radius", "20"}), 2, {"--radius 20", "metres"});
  expect_refused(replay({"--radius-range", "2:3"}), 2, {"radius 2 m: larger than the scene"});
}

TEST_F(Replay, AConfigWithAnUnknownKeyIsRefused) {
  make_recording();
  write_text(output_ / "c.json", R"({"radius": 0.02})");
  expect_refused(replay({"--config", (output_ / "c.json").string()}), 2,
                 {"c.json", "radius: unknown key", "did you mean radius_m?", "known are"});
  expect_refused(replay({"--config", "/nowhere/c.json"}), 2, {"--config /nowhere/c.json: cannot be read"});
}

TEST_F(Replay, FlagsWinOverTheConfigAndPrintConfigShowsBoth) {
  write_text(output_ / "c.json", R"({"radius_m": 0.02, "threads": 3})");
  const ProgramEnd end =
      run({"replay", "--config", (output_ / "c.json").string(), "--radius", "0.03", "--print-config"});
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, AllOf(HasSubstr("\"radius_m\": 0.03"), HasSubstr("\"threads\": 3")));
}

TEST_F(Replay, NoOutputGoesOverTheRecording) {
  make_recording();
  write_text(recording_ / "truth.jsonl", "true\n");
  for (const char* own : {"depth.txt", "camera_info.yaml", "truth.jsonl"})
    expect_refused(replay({"--out", (recording_ / own).string()}), 2, {"--out", own, "is a file of the recording"});
  expect_refused(replay({"--out", image(0).string()}), 2, {"is a file of the recording"});
  expect_refused(replay({"--overlay", image(0).parent_path().string()}), 2, {"--overlay", "the recording itself"});
  expect_refused(replay({"--overlay", recording_.path().string() + "/"}), 2, {"--overlay", "the recording itself"});
  write_text(recording_ / "noise.json", "{}\n");
  for (const std::string& heights : {image(0).string(), (recording_ / "noise.png").string()})
    expect_refused(replay({"--noise", "kinect1", "--map", "plane", "--save-heightmap", heights}), 2,
                   {"--save-heightmap", "a file of the recording"});
  std::filesystem::remove(recording_ / "noise.json");
  EXPECT_EQ(read_text(recording_ / "truth.jsonl"), "true\n");
  for (int run = 0; run < 2; ++run)
    EXPECT_EQ(replay({"--out", (recording_ / "tubes.jsonl").string()}).exit_code, 0) << "results may be made anew";
}

TEST_F(Replay, AnOutFileThatCannotBeWrittenIsNamed) {
  make_recording();
  expect_refused(replay({"--out", "/nowhere/a.jsonl"}), 2, {"--out /nowhere/a.jsonl: No such file"});
  expect_refused(replay({"--overlay", "/dev/null/pictures"}), 2, {"--overlay /dev/null/pictures"});
  const ProgramEnd full = replay({"--out", "/dev/full"});
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_THAT(full.error_lines().back(), AllOf(HasSubstr("/dev/full: No space left"), HasSubstr("0 lines")));
}

struct BadFlag {
  std::string name;
  std::vector<std::string> flags;
  std::vector<std::string> words;
};

void PrintTo(const BadFlag& bad, std::ostream* out) {
  *out << testing::PrintToString(bad.flags);
}

class MalformedFlag : public Replay, public testing::WithParamInterface<BadFlag> {};

TEST_P(MalformedFlag, IsOneLineWithFlagValueAndForm) {
  make_recording();
  expect_refused(replay(GetParam().flags), 2, GetParam().words);
}

INSTANTIATE_TEST_SUITE_P(
    Flags, MalformedFlag,
    testing::Values(
        BadFlag{"RadiusText", {"--radius", "thick"}, {"--radius thick: takes", "metres, above 0, like 0.02"}},
        BadFlag{"RadiusZero", {"--radius", "0"}, {"--radius 0: takes"}},
        BadFlag{"RadiusNegative", {"--radius", "-0.02"}, {"--radius -0.02: takes"}},
        BadFlag{"RadiusNan", {"--radius", "nan"}, {"--radius nan: takes"}},
        BadFlag{"RadiusUnit", {"--radius", "20mm"}, {"--radius 20mm: takes"}},
        BadFlag{"RadiusMissing", {"--radius"}, {"--radius", "missing"}},
        BadFlag{"RadiusTwice", {"--radius", "0.02", "--radius-range", "0.01:0.03"}, {"--radius and --radius-range"}},
        BadFlag{"RangeReversed", {"--radius-range", "0.03:0.01"}, {"--radius-range 0.03:0.01: takes MIN:MAX"}},
        BadFlag{"RangeHalf", {"--radius-range", "0.03:"}, {"--radius-range 0.03:: takes MIN:MAX"}},
        BadFlag{"DepthRange", {"--depth-range", "1,2"}, {"--depth-range 1,2: takes MIN:MAX"}},
        BadFlag{"Roi", {"--roi", "1,2,3"}, {"--roi 1,2,3: takes u,v,w,h"}},
        BadFlag{"RoiOutside", {"--roi", "10,10,10,10"}, {"--roi 10,10,10,10", "16 x 12"}},
        BadFlag{"Threads", {"--threads", "many"}, {"--threads many: takes a whole number"}},
        BadFlag{"ThreadsTooMany", {"--threads", "1000"}, {"--threads 1000", "1 to 16"}},
        BadFlag{"Noise", {"--noise", "kinect9"}, {"--noise kinect9: takes kinect1, stereo, tof"}},
        BadFlag{"NoiseFile", {"--noise", "/nowhere/n.json"}, {"--noise /nowhere/n.json: cannot be read"}},
        BadFlag{"SaveHeightmap", {"--save-heightmap", "a.png"}, {"--save-heightmap", "--map plane"}},
        BadFlag{"HeightmapName", {"--map", "plane", "--save-heightmap", "a.tif"}, {"ends in .png"}},
        BadFlag{"CellSize", {"--map", "plane", "--cell-size", "2"}, {"--cell-size 2: takes metres, 0.0001 to 0.1"}},
        BadFlag{"VaryingRadius", {"--varying-radius", "--radius", "0.02"}, {"--varying-radius", "--radius-range"}},
        BadFlag{"Map", {"--map", "round"}, {"--map round: takes image or plane"}},
        BadFlag{"Pace", {"--pace", "slow"}, {"--pace slow: takes fast or realtime"}},
        BadFlag{"Frames", {"--frames", "5"}, {"--frames 5: takes A:B"}},
        BadFlag{"FramesReversed", {"--frames", "5:3"}, {"--frames 5:3: takes A:B"}},
        BadFlag{"Intrinsics", {"--intrinsics", "500,500"}, {"--intrinsics 500,500: takes fx,fy,cx,cy"}},
        BadFlag{"IntrinsicsZero", {"--intrinsics", "0,500,8,6"}, {"--intrinsics 0,500,8,6: takes"}},
        BadFlag{"DepthScale", {"--depth-scale", "-1"}, {"--depth-scale -1: takes metres of one depth unit"}},
        BadFlag{"PlaneDeadline", {"--map", "plane", "--deadline-ms", "5"}, {"--deadline-ms: is a frame's"}},
        BadFlag{"Deadline", {"--deadline-ms", "0"}, {"--deadline-ms 0: got 0, takes milliseconds"}},
        BadFlag{"RangeTooLarge", {"--radius-range", "0.1:20"}, {"--radius-range 0.1:20: got 20, takes metres, MIN to"}},
        BadFlag{"RadiusTooLarge", {"--radius", "12.5"}, {"tubetrack: --radius 12.5: got 12.5, takes metres"}},
        BadFlag{"GivenTwice", {"--radius", "1", "--radius", "2"}, {"--radius: is given 2 times, takes M once; see"}},
        BadFlag{"SwitchWithValue", {"--view=maybe"}, {"--view: takes no value; see"}},
        BadFlag{"TooMany", {"b", "c"}, {"tubetrack: b: one argument too many; see"}},
        BadFlag{"OfAnother", {"--tolerence", "1"}, {"--tolerence: no such flag, the nearest is --tolerance; see"}},
        BadFlag{"OfScan", {"--lra", "a.csv"}, {"tubetrack: --lra: is a flag of scan alone; see"}},
        BadFlag{"Unknown", {"--colour", "red"}, {"tubetrack: --colour: no such flag; see tubetrack replay --help"}}),
    [](const auto& test) { return test.param.name; });

TEST_F(Replay, WithoutRecordingOrCommandHelpIsOffered) {
  expect_refused(run({"replay"}), 2, {"RECORDING"});
  const ProgramEnd alone = run({});
  EXPECT_EQ(alone.exit_code, 2);
  EXPECT_THAT(alone.err, AllOf(HasSubstr("replay"), HasSubstr("eval")));
  expect_refused(run({"paly"}), 2, {"paly: no such command; see tubetrack --help"});
  expect_refused(run({"reply", "x"}), 2, {"reply: no such command, the nearest is replay; see tubetrack --help"});
  expect_refused(run({"--radius", "0.02", "replay", "x"}), 2,
                 {"--radius: stands where no flag is read; put it right behind replay; see"});
  EXPECT_EQ(run({"--version"}).exit_code, 0);
  EXPECT_THAT(run({"--version"}).out, StartsWith("tubetrack "));
  EXPECT_THAT(run({"replay", "--help"}).out, AllOf(HasSubstr("--radius"), HasSubstr("Examples:")));
}

}  // namespace
}  // namespace tubetrack
