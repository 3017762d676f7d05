#include "tubetrack/report/result_json.hpp"

#include <gmock/gmock.h>

#include "replay/recording_files.hpp"
#include "report/schema_check.hpp"

namespace tubetrack {
namespace {

using test::schema_complaints;
using test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

Tube bent_tube() {
  Tube tube;
  tube.id = 7;
  tube.state = TubeState::occluded;
  tube.radius_m = 0.0200998;
  tube.radius_sigma_m = 0.000123456;
  tube.length_m = 0.52;
  tube.confidence = 0.93;
  tube.centerline_m = {{0.1, -1e-9, 0.8}, {0.1234567, 0.0, 0.8}};
  tube.sigma_m = {0.0002, 0.0003};
  tube.node_covariance_m2 = {Eigen::Matrix3d::Identity() * 4e-8, Eigen::Matrix3d::Identity() * 9e-8};
  tube.node_visible = {true, false};
  tube.segments = {{Segment::Type::straight, 0.0, 0.2, 0.0, 0.0},
                   {Segment::Type::arc, 0.2, 0.3, 0.1, 1.05},
                   {Segment::Type::free, 0.3, 0.52, 0.0, 0.0}};
  return tube;
}

TubeFrame frame_with(TrackStatus status) {
  TubeFrame frame;
  frame.frame = 12;
  frame.timestamp_s = 1000.4;
  frame.status = status;
  frame.latency_ms = 2.1;
  frame.stages = {0.6, 0.8, 0.2, 0.2, 0.2, 0.1};
  if (status == TrackStatus::ok) frame.tubes = {bent_tube()};
  if (status == TrackStatus::corrupt || status == TrackStatus::no_pose) frame.problem = "depth/000012.png: truncated";
  return frame;
}

TEST(ResultLine, HasTheKeysOfTheDesignInItsOrderRoundedToAMicrometre) {
  EXPECT_EQ(result_line(frame_with(TrackStatus::ok), true),
            R"({"frame":12,"timestamp_s":1000.4,"frame_id":"camera","status":"ok","dropped":0,"latency_ms":2.1,)"
            R"("stages_ms":{"update":0.6,"normals":0.8,"accumulate":0.2,"trace":0.2,"fit":0.2,"segment":0.1},)"
            R"("tubes":[{"id":7,"state":"occluded","radius_m":0.0201,"radius_sigma_m":0.000123,"length_m":0.52,)"
            R"("confidence":0.93,"centerline_m":[[0.1,0.0,0.8],[0.123457,0.0,0.8]],"sigma_m":[0.0002,0.0003],)"
            R"("node_covariance_m2":[[4e-08,0.0,0.0,4e-08,0.0,4e-08],[9e-08,0.0,0.0,9e-08,0.0,9e-08]],)"
            R"("node_visible":[true,false],"segments":[{"type":"straight","from_m":0.0,"to_m":0.2,"length_m":0.2},)"
            R"({"type":"arc","from_m":0.2,"to_m":0.3,"bend_radius_m":0.1,"bend_angle_rad":1.05},)"
            R"({"type":"free","from_m":0.3,"to_m":0.52,"length_m":0.22}]}]})");
}

TEST(ResultLine, WithoutTimingHoldsNoTimes) {
  const std::string line = result_line(frame_with(TrackStatus::ok), false);
  EXPECT_THAT(line, AllOf(Not(HasSubstr("latency_ms")), Not(HasSubstr("stages_ms")), HasSubstr("timestamp_s")));
}

TEST(ResultLine, SaysWhyAFrameIsBadEvenInABrokenEncoding) {
  TubeFrame frame = frame_with(TrackStatus::corrupt);
  frame.problem = "b\xfc.png: truncated";
  EXPECT_THAT(result_line(frame, false), HasSubstr("\"error\":\"b\xEF\xBF\xBD.png: truncated\""));
}

TEST(ResultLine, EveryKindOfLineHoldsAgainstTheSchema) {
  std::vector<std::string> lines;
  for (const auto status :
       {TrackStatus::ok, TrackStatus::empty, TrackStatus::corrupt, TrackStatus::no_pose, TrackStatus::deadline}) {
    lines.push_back(result_line(frame_with(status), true));
    lines.push_back(result_line(frame_with(status), false));
  }
  const TemporaryFolder folder;
  EXPECT_EQ(schema_complaints(lines, folder.path()), "");
}

TEST(ResultLine, EveryStateHiddenNodesAndAVaryingRadiusHoldAgainstTheSchemaAndReadBack) {
  std::vector<std::string> lines;
  for (const auto state : {TubeState::tracked, TubeState::occluded, TubeState::lost}) {
    for (const bool varying : {false, true}) {
      TubeFrame frame = frame_with(TrackStatus::ok);
      frame.tubes[0].state = state;
      frame.tubes[0].node_visible = {false, false};
      if (varying) frame.tubes[0].node_radius_m = {0.0200998, 0.0187};
      if (varying) frame.tubes[0].node_radius_sigma_m = {0.000123, 0.0002};
      lines.push_back(result_line(frame, true));
      const auto again = parse_result_line(lines.back());
      ASSERT_TRUE(again) << again.error().message;
      EXPECT_EQ(again->tubes[0].state, state);
      EXPECT_EQ(again->tubes[0].node_radius_m, varying ? std::vector<double>({0.0201, 0.0187}) : std::vector<double>());
      EXPECT_EQ(again->tubes[0].node_radius_sigma_m, frame.tubes[0].node_radius_sigma_m);
      EXPECT_EQ(result_line(*again, true), lines.back());
    }
  }
  EXPECT_THAT(lines[0], Not(HasSubstr("node_radius")));
  EXPECT_THAT(
      lines[3],
      AllOf(HasSubstr(R"("state":"occluded")"), HasSubstr(R"("node_visible":[false,false])"),
            HasSubstr(R"("node_radius_m":[0.0201,0.0187],"node_radius_sigma_m":[0.000123,0.0002],"segments")")));
  const TemporaryFolder folder;
  EXPECT_EQ(schema_complaints(lines, folder.path()), "");
}

TEST(ResultLine, ABendTableHoldsAgainstTheSchemaAndReadsBack) {
  TubeFrame frame = frame_with(TrackStatus::ok);
  BendRow bend{0.2, -1.5707963, 1.05, 0.1, 0.000123456, 0.0123456, 0.00456789, 0.00078912, true};
  BendRow closing;
  closing.length_m = 0.15;
  closing.length_sigma_m = 0.0002;
  frame.tubes[0].bend_table = {{{0.1, -1e-9, 0.8}, {0.3, 0.0, 0.8}, {0.3, 0.2, 0.8}}, {bend, closing}};
  const std::string line = result_line(frame, true);
  EXPECT_THAT(
      line,
      HasSubstr(
          R"("bend_table":{"xyz_m":[[0.1,0.0,0.8],[0.3,0.0,0.8],[0.3,0.2,0.8]],"lra":[)"
          R"({"length_m":0.2,"rotation_rad":-1.570796,"angle_rad":1.05,"bend_radius_m":0.1,"length_sigma_m":0.000123,)"
          R"("rotation_sigma_rad":0.0123,"angle_sigma_rad":0.00457,"bend_radius_sigma_m":0.000789,"ill_conditioned":true},)"
          R"({"length_m":0.15,"rotation_rad":0.0,"angle_rad":0.0,"length_sigma_m":0.0002,"ill_conditioned":false}]}})"));
  const auto again = parse_result_line(line);
  ASSERT_TRUE(again) << again.error().message;
  ASSERT_EQ(again->tubes[0].bend_table.lra.size(), 2U);
  EXPECT_EQ(again->tubes[0].bend_table.lra[0].bend_radius_sigma_m, 0.000789);
  EXPECT_TRUE(again->tubes[0].bend_table.lra[0].ill_conditioned);
  EXPECT_EQ(result_line(*again, true), line);
  const TemporaryFolder folder;
  EXPECT_EQ(schema_complaints({line}, folder.path()), "");
}

TEST(ResultSchema, TakesTheLineOfTheDesign) {
  const std::string line =
      R"({"frame": 12, "timestamp_s": 1000.4, "frame_id": "camera", "status": "ok", "dropped": 0, "latency_ms": 2.1, )"
      R"("stages_ms": {"update": 0.6, "normals": 0.8, "accumulate": 0.2, "trace": 0.2, "fit": 0.2, "segment": 0.1}, )"
      R"("tubes": [{"id": 1, "state": "tracked", "radius_m": 0.0201, "radius_sigma_m": 0.0001, "length_m": 0.52, )"
      R"("confidence": 0.93, "centerline_m": [[0.1, 0.0, 0.8], [0.2, 0.0, 0.8]], "sigma_m": [0.0002, 0.0002], )"
      R"("node_covariance_m2": [[4e-8, 0, 0, 4e-8, 0, 9e-8], [4e-8, 0, 0, 4e-8, 0, 9e-8]], "node_visible": [true, true], )"
      R"("segments": [{"type": "straight", "from_m": 0.0, "to_m": 0.2, "length_m": 0.2}], )"
      R"("bend_table": {"xyz_m": [[0.1, 0.0, 0.8]], "lra": [{"length_m": 0.2, "rotation_rad": 0.0, "angle_rad": 1.05, )"
      R"("bend_radius_m": 0.1, "angle_sigma_rad": 0.004, "ill_conditioned": false}]}, )"
      R"("picks": [{"position_m": [0.1, 0.0, 0.8], "quaternion_xyzw": [0, 0, 0, 1], "grip_width_m": 0.0402, )"
      R"("clearance_m": 0.03, "score": 0.9}]}]})";
  const TemporaryFolder folder;
  EXPECT_EQ(schema_complaints({line}, folder.path()), "");
}

TEST(ResultSchema, RefusesWhatNoLineMayHold) {
  const std::string good = result_line(frame_with(TrackStatus::ok), true);
  const auto with = [&good](const std::string& from, const std::string& to) {
    std::string line = good;
    return line.replace(line.find(from), from.size(), to);
  };
  const std::vector<std::string> bad = {with("\"frame\":12", "\"frame\":-1"),
                                        with("\"ok\"", "\"fine\""),
                                        with("\"dropped\":0,", ""),
                                        with("\"ok\"", "\"corrupt\""),
                                        with("\"latency_ms\":2.1,", ""),
                                        with("0.8],", "0.8,1.0],"),
                                        with("\"radius_m\":0.0201", "\"radius_m\":0"),
                                        with("\"dropped\"", "\"droped\""),
                                        with("\"state\":\"occluded\",", "")};
  const TemporaryFolder folder;
  const std::string complaints = schema_complaints(bad, folder.path());
  for (std::size_t i = 1; i <= bad.size(); ++i) {
    EXPECT_THAT(complaints, HasSubstr("line " + std::to_string(i) + ":")) << bad[i - 1];
  }
}

TEST(ResultLine, ReadsBackToTheSameLine) {
  for (const auto status : {TrackStatus::ok, TrackStatus::empty, TrackStatus::corrupt}) {
    const std::string line = result_line(frame_with(status), true);
    const auto frame = parse_result_line(line);
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_EQ(result_line(*frame, true), line);
  }
}

TEST(ReadResultLines, NamesFileLineAndKeyOfABrokenLine) {
  const TemporaryFolder folder;
  const std::string good = result_line(frame_with(TrackStatus::ok), true);
  test::write_text(folder / "a.jsonl", good + "\n\n{\"frame\": 3}\n");
  const auto frames = read_result_lines(folder / "a.jsonl");
  ASSERT_FALSE(frames);
  EXPECT_THAT(frames.error().message, AllOf(HasSubstr("a.jsonl, line 3:"), HasSubstr("timestamp_s")));

  test::write_text(folder / "cut.jsonl", good + "\n" + good.substr(0, good.size() / 2));
  EXPECT_THAT(read_result_lines(folder / "cut.jsonl").error().message, HasSubstr("cut.jsonl, line 2:"));
  EXPECT_THAT(read_result_lines(folder / "none.jsonl").error().message, HasSubstr("none.jsonl: cannot be opened"));
}

}  // namespace
}  // namespace tubetrack
