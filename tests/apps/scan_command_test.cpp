#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "../replay/scan_files.hpp"
#include "../report/schema_check.hpp"
#include "program.hpp"

namespace tubetrack::test {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

/// A pipe of radius 6 mm, bent by 3 rad about a radius of 40 mm, ends open; in millimetres.
TestMesh bent_pipe() {
  return tube_mesh({40.0, 6.0, 3.0, 6.283185307179586, 120, 40});
}

class ScanCommand : public ::testing::Test {
 protected:
  ProgramEnd scan(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "scan");
    return Program(output_.path(), std::move(arguments)).wait();
  }
  std::string write(const std::string& name, const std::string& bytes) {
    write_bytes(folder_ / name, bytes);
    return (folder_ / name).string();
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  TemporaryFolder folder_, output_;
};

TEST_F(ScanCommand, AMeshGivesOneLineThatTheSchemaTakes) {
  const ProgramEnd end = scan({write("pipe.off", off_text(bent_pipe()))});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  ASSERT_EQ(end.out_lines().size(), 1U);
  EXPECT_EQ(schema_complaints(end.out_lines(), output_.path()), "");
  const auto line = nlohmann::json::parse(end.out);
  EXPECT_EQ(line["frame"], 0);
  EXPECT_EQ(line["frame_id"], "scan");
  ASSERT_EQ(line["tubes"].size(), 1U);
  EXPECT_NEAR(line["tubes"][0]["radius_m"].get<double>(), 0.006, 0.00005);
  EXPECT_NEAR(line["tubes"][0]["length_m"].get<double>(), 0.120, 0.002);
  EXPECT_THAT(end.err, HasSubstr("unit: mm (assumed)"));
  EXPECT_THAT(end.err, HasSubstr("1 tube(s) in"));
}

TEST_F(ScanCommand, TheSummarySaysHowFarATubeTapers) {
  TestMesh mesh = bent_pipe();
  for (Eigen::Vector3d& point : mesh.points) {
    const Eigen::Vector3d middle = 40.0 * Eigen::Vector3d(point.x(), point.y(), 0.0).normalized();
    const double from_start = 1.0 / 3.0 * std::atan2(point.y(), point.x());
    point = middle + (0.85 + 0.3 * from_start) * (point - middle);
  }
  EXPECT_THAT(scan({write("taper.off", off_text(mesh))}).err,
              ContainsRegex(" on average, 5\\.[12].. to 6\\.[78].. along it"));
  EXPECT_THAT(scan({write("pipe.off", off_text(bent_pipe()))}).err, Not(HasSubstr("on average")));
}

TEST_F(ScanCommand, UnitsScaleTheResult) {
  const std::string file = write("pipe.off", off_text(bent_pipe()));
  const auto radius = [](const ProgramEnd& end) {
    return nlohmann::json::parse(end.out)["tubes"][0]["radius_m"].get<double>();
  };
  EXPECT_NEAR(radius(scan({file, "--unit", "m"})), 6.0, 0.05);
  EXPECT_NEAR(radius(scan({file, "--radius", "0.006"})), 0.006, 1e-9);
  EXPECT_NEAR(radius(scan({file, "--radius-range", "0.004:0.01"})), 0.006, 5e-5);
  EXPECT_EQ(scan({file, "--quiet"}).err, "");
}

TEST_F(ScanCommand, EqualScansGiveEqualBytes) {
  const std::string file = write("pipe.off", off_text(bent_pipe()));
  const ProgramEnd first = scan({file, "--no-timing"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const ProgramEnd second = scan({file, "--no-timing", "--out", path("a.jsonl")});
  EXPECT_EQ(second.out, "");
  EXPECT_EQ(read_text(folder_ / "a.jsonl"), first.out);
}

TEST_F(ScanCommand, ATubeIsJudgedAgainstItsNominalPoints) {
  const std::string file = write("pipe.off", off_text(bent_pipe()));
  ASSERT_EQ(scan({file, "--xyz", path("n.csv")}).exit_code, 0);
  const ProgramEnd same = scan({file, "--nominal", path("n.csv"), "--tolerance", "0.01"});
  EXPECT_EQ(same.exit_code, 0) << same.err;
  EXPECT_EQ(schema_complaints(same.out_lines(), output_.path()), "");
  const auto nominal = nlohmann::json::parse(same.out)["nominal"][0];
  EXPECT_TRUE(nominal["pass"].get<bool>());
  EXPECT_LE(nominal["max_deviation_m"].get<double>(), 1e-6);
  // One point more than the tube has.
  std::string text = read_text(folder_ / "n.csv");
  text += "1,9,1.0,0.0,0.0\n";
  const ProgramEnd longer = scan({file, "--nominal", write("longer.csv", text), "--tolerance", "0.5"});
  EXPECT_EQ(longer.exit_code, 1);
  EXPECT_THAT(longer.err, HasSubstr("nominal tube 1 can't be compared: no tube left with"));
  EXPECT_EQ(schema_complaints(longer.out_lines(), output_.path()), "");
  const ProgramEnd broken = scan({file, "--nominal", write("broken.csv", "tube,point,x_m,y_m,z_m\n1,0,0,0,zero\n")});
  EXPECT_EQ(broken.exit_code, 1);
  EXPECT_THAT(broken.err, HasSubstr("broken.csv, line 2: \"1,0,0,0,zero\", takes five numbers"));
}

TEST_F(ScanCommand, WrongUsageIsNamedAndEndsWithTwo) {
  const std::string file = write("pipe.off", off_text(bent_pipe()));
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{file, "--unit", "inch"}, "--unit inch: takes mm, m or voxel"},
      {{file, "--radius", "-1"}, "--radius -1: takes"},
      {{file, "--radius", "0.01", "--radius-range", "0.01:0.02"}, "give one of the two"},
      {{file, "--radius-range", "0.02:0.01"}, "--radius-range 0.02:0.01: takes MIN:MAX"},
      {{file, "--tolerance", "1"}, "--tolerance: give --nominal FILE.csv as well"},
      {{file, "--nominal", path("none.csv")}, "none.csv: no such file"},
      {{file, "--grid-step", "x"}, "--grid-step x: takes metres"},
      {{file, "--out", "/nowhere/a.jsonl"}, "--out /nowhere/a.jsonl: "},
      {{file, "--mesh", path("a.xyz")}, "a.xyz: takes a name that ends in .ply, .obj, .stl"},
      {{file, "--step", path("a.iges")}, "a.iges: takes a name that ends in .step, .stp"},
      {{file, "--picture", path("a.jpg")}, "--picture " + path("a.jpg") + ": takes a name that ends in .png"},
      {{file, "--out", file}, "--out " + file + ": is the scan itself too; give another name"},
      {{file, "--xyz", path("a.csv"), "--lra", path("a.csv")}, "is --xyz too; give another name"},
      {{file, "--nominal", path("n.csv"), "--xyz", path("n.csv")}, "is what --nominal reads too; give another name"},
      {{file, "--lra", "/nowhere/a.csv"}, "--lra /nowhere/a.csv: "},
      {{path("none.off")}, "no such file"},
      {{path("")}, "is a folder"}};
  for (const auto& [arguments, message] : cases) {
    const ProgramEnd end = scan(arguments);
    EXPECT_EQ(end.exit_code, 2) << message;
    EXPECT_THAT(end.err, HasSubstr(message));
    EXPECT_EQ(end.out, "") << "before any work";
  }
  EXPECT_EQ(read_text(file), off_text(bent_pipe())) << "the scan is as it was";
}

TEST_F(ScanCommand, AFlagThatDoesNothingForTheKindOfFileIsRefused) {
  const std::string mesh = write("pipe.off", off_text(bent_pipe()));
  const std::string volume =
      write("ring.nii", nifti_bytes({60, 60, 20}, {1.0F, 1.0F, 1.0F}, torus_voxels(60, 20, 20.0, 6.0)));
  ASSERT_TRUE(cv::imwrite(path("h.png"), cv::Mat(20, 20, CV_16U, cv::Scalar(100))));
  const std::string heights = path("h.png");
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{mesh, "--label", "1"}, "--label 1: does nothing for a mesh, only for voxels; leave it out"},
      {{mesh, "--threshold", "1"}, "--threshold 1: does nothing for a mesh"},
      {{mesh, "--cell-size", "1"}, "--cell-size 1: does nothing for a mesh, only for voxels and height maps"},
      {{mesh, "--normals", "vcm"}, "--normals vcm: does nothing for a mesh"},
      {{volume, "--height-scale", "1"}, "--height-scale 1: does nothing for voxels, only for height maps"},
      {{volume, "--normals", "best"}, "--normals best: takes smooth or vcm"},
      {{heights, "--cell-size", "0.001", "--height-scale", "0.00001", "--unit", "m"},
       "--unit m: does nothing for a height map"},
      {{heights, "--cell-size", "0.001", "--height-scale", "0.00001", "--label", "1"},
       "--label 1: does nothing for a height map"}};
  for (const auto& [arguments, message] : cases) {
    const ProgramEnd end = scan(arguments);
    EXPECT_EQ(end.exit_code, 2) << message;
    EXPECT_THAT(end.err, HasSubstr(message));
    EXPECT_EQ(end.out, "");
  }
  EXPECT_EQ(scan({volume, "--normals", "vcm", "--label", "1"}).exit_code, 0);
}

TEST_F(ScanCommand, FilesThatAreNoGoodGiveOneLineAndEndWithOne) {
  const std::string whole = off_text(bent_pipe());
  const std::pair<const char*, std::string> files[] = {{"empty.off", ""},
                                                       {"cut.off", whole.substr(0, whole.size() / 2)},
                                                       {"wrong.ply", whole},
                                                       {"nan.off", "OFF\n3 1 0\n0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n"},
                                                       {"index.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"},
                                                       {"short.nii", std::string(100, '\0')}};
  for (const auto& [name, bytes] : files) {
    const ProgramEnd end = scan({write(name, bytes)});
    EXPECT_EQ(end.exit_code, 1) << name << ": " << end.err;
    EXPECT_EQ(end.error_lines().size(), 1U) << name << ": " << end.err;
    EXPECT_THAT(end.err, HasSubstr(name));
    EXPECT_EQ(end.out, "");
  }
}

TEST_F(ScanCommand, AFileThatIsNotWhatItIsNamedIsToldSo) {
  const std::string off = off_text(bent_pipe()), ply = ply_bytes(bent_pipe(), "binary_little_endian");
  const std::string nifti = nifti_bytes({8, 8, 8}, {1.0F, 1.0F, 1.0F}, std::string(512, '\1'));
  const std::tuple<const char*, std::string, const char*> cases[] = {
      {"a.stl", off, "is named .stl but begins as .off does; rename it"},
      {"b.PLY", off, "is named .PLY but begins as .off does; rename it"},
      {"c.pcd", ply, "is named .pcd but begins as .ply does; rename it"},
      {"d.off", binary_stl(bent_pipe(), "solid as many programs begin"), "is named .off but begins as .stl does"},
      {"e.mhd", nifti, "is named .mhd but begins as .nii does"},
      {"f.scan", off, "is named .scan but begins as .off does"}};
  for (const auto& [name, bytes, message] : cases) {
    const ProgramEnd end = scan({write(name, bytes)});
    EXPECT_EQ(end.exit_code, std::string(name) == "f.scan" ? 2 : 1) << name;
    EXPECT_THAT(end.err, HasSubstr(message));
  }
}

TEST_F(ScanCommand, AScanWithoutATubeSaysSo) {
  const ProgramEnd end =
      scan({write("flat.off", "OFF\n4 2 0\n0 0 0\n100 0 0\n0 100 0\n100 100 0\n3 0 1 2\n3 1 3 2\n")});
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("no tube of radius"));
  EXPECT_THAT(end.err, HasSubstr("--radius-range"));
  EXPECT_EQ(nlohmann::json::parse(end.out)["status"], "empty");
  EXPECT_EQ(schema_complaints(end.out_lines(), output_.path()), "");
}

TEST_F(ScanCommand, AScanWithoutATubeLeavesNoTubesOfAnEarlierRun) {
  const std::vector<std::pair<const char*, const char*>> outputs{
      {"--centerline", "c.csv"}, {"--xyz", "x.csv"},       {"--lra", "l.csv"},    {"--vtk", "v.vtk"},
      {"--mesh", "m.stl"},       {"--error-map", "e.ply"}, {"--picture", "p.png"}};
  std::vector<std::string> flags{
      write("flat.off", "OFF\n4 2 0\n0 0 0\n100 0 0\n0 100 0\n100 100 0\n3 0 1 2\n3 1 3 2\n")};
  for (const auto& [flag, name] : outputs) flags.insert(flags.end(), {flag, write(name, "earlier")});
  const ProgramEnd end = scan(flags);
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("4 points belong to no tube"));
  for (const auto& [flag, name] : outputs) EXPECT_THAT(read_text(folder_ / name), Not(HasSubstr("earlier"))) << name;
  EXPECT_EQ(lines_of(read_text(folder_ / "x.csv")), std::vector<std::string>{"tube,point,x_m,y_m,z_m"});
}

TEST_F(ScanCommand, AScanWithoutATubeSaysWhichStepFileIsAsItWas) {
  const std::string flat = write("flat.off", "OFF\n4 2 0\n0 0 0\n100 0 0\n0 100 0\n100 100 0\n3 0 1 2\n3 1 3 2\n");
  const ProgramEnd end = scan({flat, "--step", write("p.step", "earlier")});
  if (end.err.find("libocct-data-exchange-dev") != std::string::npos) GTEST_SKIP() << "built without OpenCASCADE";
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("p.step: there is no tube to write, it is as it was"));
}

TEST_F(ScanCommand, LengthsInMillimetresAreRefusedBeforeTheSearch) {
  const std::string file = write("pipe.off", off_text(bent_pipe()));
  for (const auto& [flag, value] : {std::pair("--radius", "6"), {"--radius-range", "4:10"}, {"--grid-step", "0.5"}}) {
    const ProgramEnd end = scan({file, flag, value});
    EXPECT_EQ(end.exit_code, 2) << flag;
    EXPECT_THAT(end.err, HasSubstr(std::string(flag) + " " + value + ": "));
    EXPECT_THAT(end.err, HasSubstr("m is too large for a scan of 0.1"));
    EXPECT_THAT(end.err, HasSubstr("is it in millimetres?"));
    EXPECT_EQ(end.out, "");
  }
  const std::string points = write("mm.csv", "tube,point,x_m,y_m,z_m\n1,0,0,0,0\n1,1,1200,0,0\n");
  const ProgramEnd nominal = scan({file, "--nominal", points});
  EXPECT_EQ(nominal.exit_code, 1);
  EXPECT_THAT(nominal.err,
              HasSubstr("mm.csv: the points of tube 1 span 1200 m, takes metres, at most 100: are they in"));
}

TEST_F(ScanCommand, AGridStepFarBelowTheScansOwnSaysWhatItCosts) {
  const std::string file = write("pipe.off", off_text(bent_pipe()));
  EXPECT_THAT(scan({file, "--grid-step", "0.0005"}).err, Not(HasSubstr("finer")));
  EXPECT_THAT(scan({file, "--grid-step", "0.00015"}).err,
              HasSubstr("note: --grid-step 0.00015: finer than the scan's own 0.0"));
}

TEST_F(ScanCommand, AFlagThatOverrulesAHeightMapsJsonSaysSo) {
  ASSERT_TRUE(cv::imwrite(path("h.png"), cv::Mat(20, 20, CV_16U, cv::Scalar(100))));
  write("h.json", R"({"cell_size_m": 0.002, "height_scale_m": 1e-5})");
  EXPECT_THAT(scan({path("h.png")}).err, Not(HasSubstr("in place of")));
  EXPECT_THAT(scan({path("h.png"), "--cell-size", "0.002"}).err, Not(HasSubstr("in place of")));
  EXPECT_THAT(scan({path("h.png"), "--cell-size", "0.001"}).err,
              HasSubstr("note: --cell-size 0.001: in place of 0.002 in " + path("h.json")));
  EXPECT_THAT(scan({path("h.png"), "--cell-size", "0.001", "--height-scale", "1e-4"}).err,
              HasSubstr("note: --cell-size, --height-scale: " + path("h.json") + " and the pose in it are not read"));
  write("h.json", "nonsense");
  const ProgramEnd broken = scan({path("h.png")});
  EXPECT_EQ(broken.exit_code, 2);
  EXPECT_THAT(broken.err, HasSubstr("h.json: parse error at line 1"));
}

/// What a script for Debian's own Python prints, where it has VTK; a skipped test where not.
std::string seen_by_vtk(const TemporaryFolder& folder, const std::string& script) {
  write_bytes(folder / "read.py", script);
  const std::string command = "/usr/bin/python3 '" + (folder / "read.py").string() + "' '" + folder.path().string() +
                              "' > '" + (folder / "seen.txt").string() + "' 2>&1";
  return std::system(command.c_str()) == 0 ? read_text(folder / "seen.txt") : "";
}

TEST_F(ScanCommand, ExportsAreReadBackByVtkAndCsvReaders) {
  if (std::system("/usr/bin/python3 -c 'import vtk' 2> /dev/null") != 0)
    GTEST_SKIP() << "python3-vtk9 is not installed";
  const ProgramEnd end = scan({write("pipe.off", off_text(bent_pipe())), "--mesh", path("m.ply"), "--centerline",
                               path("c.csv"), "--xyz", path("x.csv"), "--lra", path("l.csv"), "--vtk", path("c.vtk"),
                               "--error-map", path("e.ply"), "--picture", path("p.png")});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  for (const char* name : {"m.obj", "m.stl"}) ASSERT_EQ(scan({path("pipe.off"), "--mesh", path(name)}).exit_code, 0);
  EXPECT_THAT(end.err, HasSubstr("95 %"));
  const std::string seen = seen_by_vtk(folder_, R"(import csv, json, os, sys, vtk
folder = sys.argv[1]
seen = {}
def mesh(name, reader):
    reader.SetFileName(os.path.join(folder, name))
    reader.Update()
    clean = vtk.vtkCleanPolyData()
    clean.SetInputConnection(reader.GetOutputPort())
    measure = vtk.vtkMassProperties()
    measure.SetInputConnection(clean.GetOutputPort())
    seen[name] = [clean.GetOutput().GetNumberOfPolys() if measure.GetVolume() else 0, measure.GetVolume(), measure.GetSurfaceArea()]
mesh("m.ply", vtk.vtkPLYReader())
mesh("m.obj", vtk.vtkOBJReader())
mesh("m.stl", vtk.vtkSTLReader())
reader = vtk.vtkPLYReader()
reader.SetFileName(os.path.join(folder, "e.ply"))
reader.Update()
seen["e.ply"] = [reader.GetOutput().GetNumberOfPoints(), reader.GetOutput().GetNumberOfPolys(),
                 reader.GetOutput().GetPointData().GetScalars().GetNumberOfComponents()]
reader = vtk.vtkPolyDataReader()
reader.ReadAllScalarsOn()
reader.SetFileName(os.path.join(folder, "c.vtk"))
reader.Update()
data = reader.GetOutput()
seen["c.vtk"] = [data.GetNumberOfLines(), data.GetNumberOfPoints(), data.GetPointData().GetArray("radius_m").GetValue(0)]
for name in ["c.csv", "x.csv", "l.csv"]:
    rows = list(csv.DictReader(open(os.path.join(folder, name))))
    seen[name] = rows
print(json.dumps(seen))
)");
  ASSERT_NE(seen, "");
  const auto read = nlohmann::json::parse(seen);
  const auto tube = nlohmann::json::parse(end.out)["tubes"][0];
  const double radius_m = tube["radius_m"], length_m = tube["length_m"];
  for (const char* name : {"m.ply", "m.obj", "m.stl"}) {
    EXPECT_NEAR(read[name][1].get<double>(), M_PI * radius_m * radius_m * length_m,
                0.01 * M_PI * radius_m * radius_m * length_m)
        << name;
    EXPECT_NEAR(read[name][2].get<double>(), 2.0 * M_PI * radius_m * (length_m + radius_m),
                0.01 * 2.0 * M_PI * radius_m * length_m)
        << name;
  }
  EXPECT_EQ(read["e.ply"][0], bent_pipe().points.size());
  EXPECT_EQ(read["e.ply"][1], bent_pipe().faces.size());
  EXPECT_EQ(read["c.vtk"][0], 1);
  EXPECT_EQ(read["c.vtk"][1], tube["centerline_m"].size());
  EXPECT_NEAR(read["c.vtk"][2].get<double>(), radius_m, 1e-6);
  ASSERT_EQ(read["c.csv"].size(), tube["centerline_m"].size());
  EXPECT_NEAR(std::stod(read["c.csv"].back()["along_m"].get<std::string>()), length_m, 1e-6);
  EXPECT_EQ(read["l.csv"].size(), tube["bend_table"]["lra"].size());
  EXPECT_NEAR(std::stod(read["l.csv"][0]["angle_rad"].get<std::string>()), 3.0, 0.06);
  EXPECT_NEAR(std::stod(read["l.csv"][0]["bend_radius_m"].get<std::string>()), 0.040, 0.0005);
  EXPECT_EQ(read["x.csv"].size(), tube["bend_table"]["xyz_m"].size());
}

TEST_F(ScanCommand, StepHasTheTubesOfTheLine) {
  const ProgramEnd end = scan({write("pipe.off", off_text(bent_pipe())), "--step", path("p.step")});
  if (end.exit_code == 1 && end.err.find("libocct-data-exchange-dev") != std::string::npos)
    GTEST_SKIP() << "built without OpenCASCADE";
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_EQ(end.out_lines().size(), 1U) << "nothing of OpenCASCADE's own on stdout";
  const std::string step = read_text(folder_ / "p.step");
  EXPECT_THAT(step, HasSubstr("PRODUCT('tube 1','tube 1'"));
  EXPECT_THAT(step, HasSubstr("TOROIDAL_SURFACE"));
  // By hand the line gives the same file.
  write("line.jsonl", end.out);
  const std::string command = "'" + std::filesystem::path(TUBETRACK_PROGRAM).parent_path().string() +
                              "/tubetrack_step' '" + path("q.step") + "' < '" + path("line.jsonl") + "' > '" +
                              path("said.txt") + "'";
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(read_text(folder_ / "said.txt"), "written\n");
  EXPECT_EQ(read_text(folder_ / "q.step"), step);
}

TEST_F(ScanCommand, AClosedTubesSurfaceIsClosed) {
  if (std::system("/usr/bin/python3 -c 'import vtk' 2> /dev/null") != 0)
    GTEST_SKIP() << "python3-vtk9 is not installed";
  const std::string file = write("ring.off", off_text(tube_mesh({40.0, 6.0, 2.0 * M_PI, 2.0 * M_PI, 160, 40})));
  const ProgramEnd end = scan({file, "--mesh", path("m.stl")});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  const auto tube = nlohmann::json::parse(end.out)["tubes"][0];
  EXPECT_TRUE(tube.value("closed", false));
  EXPECT_EQ(tube["segments"].size(), 1U) << "a ring is one torus";
  const std::string seen = seen_by_vtk(folder_, R"(import json, os, sys, vtk
reader = vtk.vtkSTLReader()
reader.SetFileName(os.path.join(sys.argv[1], "m.stl"))
edges = vtk.vtkFeatureEdges()
edges.SetInputConnection(reader.GetOutputPort())
edges.FeatureEdgesOff()
edges.ManifoldEdgesOff()
edges.Update()
measure = vtk.vtkMassProperties()
measure.SetInputConnection(reader.GetOutputPort())
print(json.dumps([edges.GetOutput().GetNumberOfCells(), measure.GetVolume()]))
)");
  ASSERT_NE(seen, "");
  const auto read = nlohmann::json::parse(seen);
  EXPECT_EQ(read[0], 0);  // no open edge, and none of three faces
  const double radius_m = tube["radius_m"], length_m = tube["length_m"];
  const double volume = M_PI * radius_m * radius_m * length_m;
  EXPECT_NEAR(read[1].get<double>(), volume, 0.01 * volume);
}

TEST_F(ScanCommand, VoxelsAndHeightMapsAreReadWithTheirFlags) {
  constexpr int kSide = 120, kHeight = 30;
  const std::string voxels = torus_voxels(kSide, kHeight, 42.0, 8.0);
  const ProgramEnd volume = scan({write("ring.nii", nifti_bytes({kSide, kSide, kHeight}, {1.0F, 1.0F, 1.0F}, voxels))});
  ASSERT_EQ(volume.exit_code, 0) << volume.err;
  const auto ring = nlohmann::json::parse(volume.out)["tubes"];
  ASSERT_EQ(ring.size(), 1U);
  EXPECT_TRUE(ring[0].value("closed", false));
  EXPECT_NEAR(ring[0]["radius_m"].get<double>(), 0.008, 0.0001);
  EXPECT_NEAR(ring[0]["length_m"].get<double>(), 2.0 * M_PI * 0.042, 0.001);

  cv::Mat heights(80, 200, CV_16U, cv::Scalar(0));
  for (int row = 0; row < heights.rows; ++row) {
    const double off_mm = row - 40.0;
    for (int col = 20; col < 180 && std::abs(off_mm) < 12.0; ++col)
      heights.at<std::uint16_t>(row, col) =
          static_cast<std::uint16_t>(std::lround(100.0 * std::sqrt(144.0 - off_mm * off_mm)));
  }
  ASSERT_TRUE(cv::imwrite(path("h.png"), heights));
  EXPECT_EQ(scan({path("h.png")}).exit_code, 2);
  const ProgramEnd map = scan({path("h.png"), "--cell-size", "0.001", "--height-scale", "0.00001"});
  ASSERT_EQ(map.exit_code, 0) << map.err;
  const auto tubes = nlohmann::json::parse(map.out)["tubes"];
  ASSERT_EQ(tubes.size(), 1U);
  EXPECT_NEAR(tubes[0]["radius_m"].get<double>(), 0.012, 0.00005);
  for (const auto& node : tubes[0]["centerline_m"]) {
    EXPECT_NEAR(node[1].get<double>(), 0.040, 0.00005);
    EXPECT_NEAR(node[2].get<double>(), 0.0, 0.0001);
  }
}

TEST_F(ScanCommand, ThePictureShowsBothSurfaces) {
  const ProgramEnd end = scan({write("pipe.off", off_text(bent_pipe())), "--picture", path("p.png")});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  const cv::Mat image = cv::imread(path("p.png"));
  ASSERT_EQ(image.rows, 800);
  ASSERT_EQ(image.cols, 1600);
  int drawn[2] = {0, 0};
  for (int row = 0; row < image.rows; ++row) {
    for (int col = 0; col < image.cols; ++col)
      drawn[col / 800] += image.at<cv::Vec3b>(row, col) != cv::Vec3b(255, 255, 255) ? 1 : 0;
  }
  EXPECT_GT(drawn[0], 30'000);
  EXPECT_NEAR(drawn[1], drawn[0], 0.1 * drawn[0]);
}

/// Scans made by others. Skipped, saying so, where they are not there.
class RealScanCommand : public ScanCommand {
 protected:
  void SetUp() override {
    if (real_data().empty()) GTEST_SKIP() << "no real scans: set TUBETRACK_TEST_DATA to their folder";
  }
  nlohmann::json tubes_of(const std::string& name, std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), (real_data() / name).string());
    const ProgramEnd end = scan(flags);
    EXPECT_EQ(end.exit_code, 0) << end.err;
    std::printf("%s", end.err.c_str());
    return end.exit_code == 0 ? nlohmann::json::parse(end.out)["tubes"] : nlohmann::json::array();
  }
};

TEST_F(RealScanCommand, TheScannedSectionIsOneStraightTube) {
  const auto tubes = tubes_of("meshes/tube-section-scan.off");
  ASSERT_EQ(tubes.size(), 1U);
  EXPECT_NEAR(tubes[0]["radius_m"].get<double>(), 0.0058, 0.0002);
  ASSERT_EQ(tubes[0]["segments"].size(), 1U);
  EXPECT_EQ(tubes[0]["segments"][0]["type"], "straight");
}

TEST_F(RealScanCommand, TheTrefoilIsOneClosedTubeWithoutEnds) {
  const auto tubes = tubes_of("meshes/trefoil-tube.off");
  ASSERT_EQ(tubes.size(), 1U);
  EXPECT_TRUE(tubes[0].value("closed", false));
  EXPECT_EQ(tubes[0]["centerline_m"].front(), tubes[0]["centerline_m"].back());
}

TEST_F(RealScanCommand, WhatOpenCascadeMakesNoSolidOfIsWrittenAsAllElse) {
  const ProgramEnd end = scan({(real_data() / "meshes/trefoil-tube.off").string(), "--lra", path("t.csv"), "--mesh",
                               path("t.ply"), "--picture", path("t.png"), "--step", path("t.step")});
  if (end.err.find("libocct-data-exchange-dev") != std::string::npos) GTEST_SKIP() << "built without OpenCASCADE";
  EXPECT_EQ(end.exit_code, std::filesystem::exists(path("t.step")) ? 0 : 1);
  for (const char* name : {"t.csv", "t.ply", "t.png"}) EXPECT_TRUE(std::filesystem::exists(path(name))) << name;
}

TEST_F(RealScanCommand, TheAortaIsOneTubeThroughoutItsCane) {
  const auto tubes = tubes_of("aorta-ct/aorta_true_lumen.nii.gz");
  ASSERT_GE(tubes.size(), 1U);
  // From end to end: of its voxels 99.97 % lie within 1.5 of the nodes' radii of a line of 0.327 m, all within 2.
  EXPECT_GT(tubes[0]["length_m"].get<double>(), 0.32);
}

TEST_F(RealScanCommand, ThePulmonaryArteryBranches) {
  const ProgramEnd end = scan({(real_data() / "aorta-ct/pulmonary_artery.nii.gz").string()});
  ASSERT_EQ(end.exit_code, 0) << end.err;
  std::printf("%s", end.err.c_str());
  EXPECT_EQ(schema_complaints(end.out_lines(), output_.path()), "");
  const auto line = nlohmann::json::parse(end.out);
  ASSERT_TRUE(line.contains("joints"));
  // Two of its three arms are one tube; the third leaves from its flank.
  int branches = 0;
  for (const auto& joint : line["joints"]) {
    const auto& parts = joint["tubes"];
    if (parts.size() == 2 && parts[0]["id"] == 2 && parts[0]["at"] != "flank" && parts[1]["id"] == 1 &&
        parts[1]["at"] == "flank")
      ++branches;
  }
  EXPECT_EQ(branches, 1);
}

TEST_F(RealScanCommand, TheLamppostsPoleIsStraight) {
  const auto tubes = tubes_of("clouds/lamppost.pcd", {"--unit", "m"});
  ASSERT_GE(tubes.size(), 1U);
  EXPECT_GT(tubes[0]["length_m"].get<double>(), 1.2);
  EXPECT_NEAR(tubes[0]["radius_m"].get<double>(), 0.068, 0.008);
}

}  // namespace
}  // namespace tubetrack::test
