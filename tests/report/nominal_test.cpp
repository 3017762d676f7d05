#include "tubetrack/report/nominal.hpp"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "replay/recording_files.hpp"
#include "report/schema_check.hpp"
#include "tubetrack/report/scan_json.hpp"
#include "tubetrack/report/tube_tables.hpp"
#include "tubetrack/tracker/bend_table.hpp"

namespace tubetrack {
namespace {

void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path) << text;
}

using testing::HasSubstr;

/// Three bends in two planes, one of 170°, which counts as two halves.
PartChain chain() {
  PartChain chain;
  chain.bends = {{0.10, 0.0, 1.2, 0.030}, {0.06, 1.0, 2.97, 0.040}, {0.08, -2.0, 1.6, 0.024}};
  chain.closing_m = 0.09;
  return chain;
}

Tube tube_of(const PartChain& chain) {
  Tube tube;
  tube.id = 4;
  tube.radius_m = 0.006;
  tube.centerline_m = points_along(chain, 0.01);
  tube.bend_table = bend_table_of({chain, RecycledVector<BendSigma>(chain.bends.size()), 0.0});
  return tube;
}

NominalTube nominal_of(const Tube& tube, bool reversed) {
  const Eigen::Isometry3d motion =
      Eigen::Translation3d(1.0, -2.0, 0.5) * Eigen::AngleAxisd(2.0, Eigen::Vector3d(1.0, 2.0, -1.0).normalized());
  NominalTube nominal{1, tube.bend_table.xyz_m};
  if (reversed) std::reverse(nominal.xyz_m.begin(), nominal.xyz_m.end());
  for (Eigen::Vector3d& point : nominal.xyz_m) point = motion * point;
  return nominal;
}

TEST(Nominal, ATubeDeviatesFromItselfByNothingWhereverItLiesAndFromEitherEnd) {
  const Tube tube = tube_of(chain());
  for (const bool reversed : {false, true}) {
    const auto compared = compare_with_nominal(std::vector{nominal_of(tube, reversed)}, std::vector{tube});
    ASSERT_EQ(compared.size(), 1U);
    EXPECT_EQ(compared[0].problem, "");
    EXPECT_EQ(compared[0].tube, 4);
    EXPECT_EQ(compared[0].reversed, reversed);
    EXPECT_EQ(compared[0].points.size(), 2U + 2U * 4U);
    EXPECT_LE(compared[0].max_deviation_m, 1e-9);
    EXPECT_LE(compared[0].max_sheath_m, 1.5e-6);  // arcs in steps
    EXPECT_TRUE(compared[0].within(1e-5));
  }
}

TEST(Nominal, ALengthThatIsOffShowsAsDeviationAndNotAtTheSheathBesideIt) {
  PartChain straight;
  straight.closing_m = 0.20;
  Tube tube = tube_of(straight);
  NominalTube nominal = nominal_of(tube, false);
  nominal.xyz_m[1] += 0.002 * (nominal.xyz_m[1] - nominal.xyz_m[0]).normalized();
  const auto compared = compare_with_nominal(std::vector{nominal}, std::vector{tube});
  ASSERT_EQ(compared[0].points.size(), 2U);
  for (const NominalPoint& point : compared[0].points) {  // a millimetre at either end
    EXPECT_NEAR(point.deviation_m, 0.001, 1e-9);
    EXPECT_NEAR(point.sheath_m, 0.0, 1e-9);
  }
  EXPECT_TRUE(compared[0].within(0.0011));
  EXPECT_FALSE(compared[0].within(0.0009));
}

TEST(Nominal, ABendThatIsOffShowsByHowMuch) {
  const Tube nominal_tube = tube_of(chain());
  PartChain bent = chain();
  bent.bends[2].angle_rad += 0.02;
  const Tube tube = tube_of(bent);
  const auto compared = compare_with_nominal(std::vector{nominal_of(nominal_tube, true)}, std::vector{tube});
  ASSERT_EQ(compared[0].problem, "");
  EXPECT_TRUE(compared[0].reversed);
  // The last 90 mm turn by 0.02 rad: 1.8 mm at the end before the position was chosen, which shares it out.
  EXPECT_GT(compared[0].max_deviation_m, 0.0005);
  EXPECT_LT(compared[0].max_deviation_m, 0.0018);
  EXPECT_EQ(std::max_element(compared[0].points.begin(), compared[0].points.end(),
                             [](const auto& a, const auto& b) { return a.deviation_m < b.deviation_m; })
                ->at,
            NominalPoint::At::start);
  EXPECT_GE(compared[0].max_sheath_m, compared[0].points.front().sheath_m - 1e-6);
}

TEST(Nominal, EachNominalTubeGetsATubeOfItsOwn) {
  PartChain other = chain();
  other.bends[0].angle_rad = 0.7;
  Tube a = tube_of(chain()), b = tube_of(other);
  a.id = 1;
  b.id = 2;
  const std::vector<NominalTube> nominal{nominal_of(b, false), nominal_of(a, false), nominal_of(a, false)};
  const auto compared = compare_with_nominal(nominal, std::vector{a, b});
  EXPECT_EQ(compared[0].tube, 2);
  EXPECT_EQ(compared[1].tube, 1);
  EXPECT_THAT(compared[2].problem, HasSubstr("no tube left with 6 XYZ points: tube 1 has 6 XYZ points"));
  EXPECT_FALSE(compared[2].within(1.0));
}

const std::vector<TubeJoint> kJoints{
    {{0.1, 0.2, 0.3}, {{7, TubeJoint::At::end, 0.52}, {8, TubeJoint::At::flank, 0.25}}}};

std::vector<NominalComparison> one_good_and_one_not() {
  const std::vector<NominalTube> nominal{nominal_of(tube_of(chain()), true), {2, {{0, 0, 0}, {1, 0, 0}}}};
  return compare_with_nominal(nominal, std::vector{tube_of(chain())});
}

TEST(ScanLine, JointsAndNominalTubesKeepToTheSchema) {
  const test::TemporaryFolder folder;
  TubeFrame frame;
  frame.frame_id = "scan";
  const auto compared = one_good_and_one_not();
  const std::vector<std::string> lines{line_with_findings(frame, false, {kJoints, compared, 0.0005}),
                                       line_with_findings(frame, false, {{}, compared, std::nullopt})};
  EXPECT_EQ(test::schema_complaints(lines, folder.path()), "");
  EXPECT_THAT(lines[0],
              HasSubstr(R"("joints":[{"position_m":[0.1,0.2,0.3],"tubes":[{"id":7,"at":"end","along_m":0.52},)"
                        R"({"id":8,"at":"flank","along_m":0.25}]}])"));
  EXPECT_THAT(lines[0], HasSubstr(R"("pass":true)"));
  EXPECT_THAT(lines[0], HasSubstr(R"("pass":false)"));
}

TEST(ScanLine, IsReadBackWithItsJointsAndNominalTubes) {
  TubeFrame frame;
  frame.frame_id = "scan";
  const auto compared = one_good_and_one_not();
  for (const std::string& line : {line_with_findings(frame, false, {kJoints, compared, 0.0005}),
                                  line_with_findings(frame, false, {{}, compared, std::nullopt}),
                                  line_with_findings(frame, false, {kJoints, {}, std::nullopt})}) {
    const auto read = parse_scan_line(line);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(line_with_findings(read->frame, false, {read->joints, read->nominal, read->tolerance_m}), line);
  }
  std::string wrong = line_with_findings(frame, false, {kJoints, {}, std::nullopt});
  wrong.replace(wrong.find("flank"), 5, "shore");
  const auto read = parse_scan_line(wrong);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, HasSubstr("\"at\": \"shore\" is not known"));
}

TEST(Nominal, TheFileIsWhatXyzCsvWrites) {
  const test::TemporaryFolder folder;
  const Tube tube = tube_of(chain());
  write_text(folder / "n.csv", xyz_csv(std::vector{tube}));
  const auto read = read_nominal_csv(folder / "n.csv");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), 1U);
  EXPECT_EQ(read->front().id, 4);
  ASSERT_EQ(read->front().xyz_m.size(), tube.bend_table.xyz_m.size());
  for (std::size_t i = 0; i < tube.bend_table.xyz_m.size(); ++i)
    EXPECT_LE((read->front().xyz_m[i] - tube.bend_table.xyz_m[i]).norm(), 1e-7);
}

TEST(Nominal, FilesThatAreNoGoodAreRefusedByLine) {
  const test::TemporaryFolder folder;
  const std::pair<const char*, const char*> cases[] = {
      {"", "no points"},
      {"x,y,z\n1,2,3\n", "line 1: \"x,y,z\", takes tube,point,x_m,y_m,z_m"},
      {"tube,point,x_m,y_m,z_m\n", "no points"},
      {"tube,point,x_m,y_m,z_m\n1,0,0,0\n", "line 2: \"1,0,0,0\", takes five numbers"},
      {"tube,point,x_m,y_m,z_m\n1,0,0,0,0,0\n", "line 2"},
      {"tube,point,x_m,y_m,z_m\n1,0,0,0,nan\n", "line 2"},
      {"tube,point,x_m,y_m,z_m\n1,0,0,0,0\n", "tube 1 has one point"},
      {"tube,point,x_m,y_m,z_m\n1,0,0,0,0\n1,1,0,0,0\n", "line 3: \"1,1,0,0,0\", takes a point apart"}};
  for (const auto& [text, message] : cases) {
    write_text(folder / "n.csv", text);
    const auto read = read_nominal_csv(folder / "n.csv");
    ASSERT_FALSE(read) << text;
    EXPECT_THAT(read.error().message, HasSubstr(message));
    EXPECT_THAT(read.error().message, HasSubstr("n.csv"));
  }
}

TEST(Nominal, PointsInMillimetresAreNotTakenForMetres) {
  const test::TemporaryFolder folder;
  write_text(folder / "n.csv", "tube,point,x_m,y_m,z_m\n7,0,0,0,0\n7,1,300,0,0\n7,2,300,400,0\n");
  const auto read = read_nominal_csv(folder / "n.csv");
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, HasSubstr("the points of tube 7 span 500 m, takes metres"));
  EXPECT_THAT(read.error().message, HasSubstr("are they in millimetres?"));
  write_text(folder / "n.csv", "tube,point,x_m,y_m,z_m\n7,0,5000,0,0\n7,1,5030,0,0\n");
  EXPECT_TRUE(read_nominal_csv(folder / "n.csv")) << "far from zero, but short";
}

}  // namespace
}  // namespace tubetrack
