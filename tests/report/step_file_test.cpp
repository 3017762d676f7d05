#include <gmock/gmock.h>

#ifndef TUBETRACK_HAS_STEP

TEST(StepFile, IsWrittenByOpenCascade) {
  GTEST_SKIP() << "built without OpenCASCADE; install libocct-data-exchange-dev";
}

#else

#include <BRepCheck_Analyzer.hxx>
#include <BRepGProp.hxx>
#include <GProp_GProps.hxx>
#include <STEPControl_Reader.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS_Shape.hxx>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <numbers>
#include <sstream>
#include <string>

#include "replay/recording_files.hpp"
#include "tubetrack/report/step_file.hpp"
#include "tubetrack/tracker/bend_table.hpp"

namespace tubetrack {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kPi = std::numbers::pi;

/// Three bends in two planes, two of them without a straight between.
PartChain bent_chain() {
  PartChain chain;
  chain.start_m = {0.3, -0.2, 0.9};
  chain.direction = Eigen::Vector3d(1.0, 2.0, -1.0).normalized();
  chain.towards = chain.direction.unitOrthogonal();
  chain.bends = {{0.10, 0.0, 1.2, 0.030}, {0.06, 1.0, 2.97, 0.040}, {0.0, -2.0, 1.6, 0.024}};
  chain.closing_m = 0.09;
  return chain;
}

Tube tube_of(std::int64_t id, const PartChain& chain) {
  Tube tube;
  tube.id = id;
  tube.radius_m = 0.006;
  tube.centerline_m = points_along(chain, 0.003);
  tube.length_m = length_of(chain);
  tube.bend_table = bend_table_of({chain, RecycledVector<BendSigma>(chain.bends.size()), 0.0});
  return tube;
}

/// A line without parts: a helix, or a trefoil where it is closed.
Tube free_tube(std::int64_t id, bool closed) {
  Tube tube;
  tube.id = id;
  tube.radius_m = 0.004;
  tube.closed = closed;
  constexpr int kNodes = 150;
  for (int i = 0; i <= kNodes; ++i) {
    const double u = 2.0 * kPi * i / kNodes, out_m = 0.05 + 0.02 * std::cos(3.0 * u);
    tube.centerline_m.push_back(
        closed ? Eigen::Vector3d(out_m * std::cos(2.0 * u), out_m * std::sin(2.0 * u), 0.02 * std::sin(3.0 * u))
               : Eigen::Vector3d(0.05 * std::cos(u), 0.05 * std::sin(u), 0.01 * u));
    if (i > 0) tube.length_m += (tube.centerline_m[i] - tube.centerline_m[i - 1]).norm();
  }
  if (closed) tube.centerline_m.back() = tube.centerline_m.front();
  return tube;
}

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The numbers at the end of each entity of that name, in the file's order: radii, in millimetres.
std::vector<std::vector<double> > radii_of(const std::string& step, const std::string& entity) {
  std::string joined = step;
  std::erase(joined, '\n');
  std::vector<std::vector<double> > all;
  const std::string opening = entity + "('";
  for (std::size_t at = joined.find(opening); at != std::string::npos; at = joined.find(opening, at + 1)) {
    const std::size_t name_end = joined.find("',#", at + opening.size());
    const std::size_t first = joined.find(',', name_end + 3) + 1;  // behind the number of the placement
    std::stringstream numbers(joined.substr(first, joined.find(')', first) - first));
    all.emplace_back();
    for (std::string number; std::getline(numbers, number, ',');) all.back().push_back(std::stod(number));
  }
  return all;
}

/// What a CAD program makes of a file.
struct Solids {
  bool valid = true;
  int solids = 0;
  std::vector<double> volume_mm3;
  std::vector<double> adaptive_mm3;  ///< for surfaces of splines, for which OpenCASCADE's default errs by 0.2 %
};

Solids read_back(const std::filesystem::path& path) {
  STEPControl_Reader reader;
  Solids seen;
  seen.valid = reader.ReadFile(path.c_str()) == IFSelect_RetDone && reader.TransferRoots() > 0;
  const TopoDS_Shape all = reader.OneShape();
  seen.valid = seen.valid && BRepCheck_Analyzer(all).IsValid();
  for (TopExp_Explorer solid(all, TopAbs_SOLID); solid.More(); solid.Next()) {
    GProp_GProps volume;
    BRepGProp::VolumeProperties(solid.Current(), volume);
    seen.volume_mm3.push_back(volume.Mass());
    GProp_GProps adaptive;
    BRepGProp::VolumeProperties(solid.Current(), adaptive, 1e-5);
    seen.adaptive_mm3.push_back(adaptive.Mass());
    ++seen.solids;
  }
  return seen;
}

class StepFile : public testing::Test {
 protected:
  test::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "tubes.step";
};

TEST_F(StepFile, ABendTableBecomesCylindersAndToriWithItsRadiiInMillimetres) {
  const auto notes = write_step(path_, std::vector{tube_of(7, bent_chain())});
  ASSERT_TRUE(notes) << notes.error().message;
  EXPECT_EQ(notes->size(), 0U);
  const std::string step = text_of(path_);
  EXPECT_THAT(step, HasSubstr("PRODUCT('tube 7','tube 7'"));
  const auto cylinders = radii_of(step, "CYLINDRICAL_SURFACE"), tori = radii_of(step, "TOROIDAL_SURFACE");
  ASSERT_EQ(cylinders.size(), 3U);
  for (const auto& numbers : cylinders) {
    ASSERT_EQ(numbers.size(), 1U);
    EXPECT_NEAR(numbers[0], 6.0, 1e-9);
  }
  ASSERT_EQ(tori.size(), 3U);
  const double bends_mm[] = {30.0, 40.0, 24.0};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(tori[i][0], bends_mm[i], 1e-9);
    EXPECT_NEAR(tori[i][1], 6.0, 1e-9);
  }
  EXPECT_EQ(radii_of(step, "B_SPLINE_SURFACE_WITH_KNOTS").size(), 0U);
  const Solids seen = read_back(path_);
  EXPECT_TRUE(seen.valid);
  ASSERT_EQ(seen.solids, 1);
  EXPECT_NEAR(seen.volume_mm3[0] / (kPi * 36.0), 1e3 * length_of(bent_chain()), 1e-3);  // so it is as long
}

TEST_F(StepFile, AStraightTubeAndARingAreOneSurfaceEach) {
  PartChain straight;
  straight.closing_m = 0.2;
  PartChain ring;
  ring.bends = {{0.0, 0.0, 2.0 * kPi, 0.04}};
  Tube closed = tube_of(2, ring);
  closed.closed = true;
  const auto notes = write_step(path_, std::vector{tube_of(1, straight), closed});
  ASSERT_TRUE(notes) << notes.error().message;
  EXPECT_EQ(notes->size(), 0U);
  const std::string step = text_of(path_);
  EXPECT_THAT(radii_of(step, "CYLINDRICAL_SURFACE"), ElementsAre(ElementsAre(6.0)));
  EXPECT_THAT(radii_of(step, "TOROIDAL_SURFACE"), ElementsAre(ElementsAre(40.0, 6.0)));
  EXPECT_THAT(step, HasSubstr("PRODUCT('tube 1','tube 1'"));
  EXPECT_THAT(step, HasSubstr("PRODUCT('tube 2','tube 2'"));
  const Solids seen = read_back(path_);
  EXPECT_TRUE(seen.valid);
  ASSERT_EQ(seen.solids, 2);
  EXPECT_NEAR(seen.volume_mm3[0], kPi * 36.0 * 200.0, 1e-3);
  EXPECT_NEAR(seen.volume_mm3[1], kPi * 36.0 * 2.0 * kPi * 40.0, 0.1);
}

TEST_F(StepFile, WhatIsFreeIsASurfaceThroughItsSectionsAndANoteSaysSo) {
  for (const bool closed : {false, true}) {
    const Tube tube = free_tube(3, closed);
    const auto notes = write_step(path_, std::vector{tube});
    ASSERT_TRUE(notes) << notes.error().message;
    EXPECT_THAT(*notes, ElementsAre("tube 3: not all straight and toric: a spline surface through its nodes' "
                                    "sections, 8.000 mm thick throughout"));
    const Solids seen = read_back(path_);
    EXPECT_TRUE(seen.valid);
    ASSERT_EQ(seen.solids, 1);
    const double expected = kPi * 16.0 * 1e3 * tube.length_m;
    EXPECT_NEAR(seen.adaptive_mm3[0], expected, 1e-3 * expected);
  }
}

TEST_F(StepFile, AClosedLineOfFewUnevenNodesBecomesASolid) {
  Tube tube = free_tube(1, true), few = tube;
  few.centerline_m.clear();
  few.length_m = 0.0;
  for (std::size_t i = 0; i + 1 < tube.centerline_m.size(); i += i % 3 == 0 ? 2 : 1)
    few.centerline_m.push_back(tube.centerline_m[i]);
  few.centerline_m.push_back(few.centerline_m.front());
  const auto notes = write_step(path_, std::vector{few});
  ASSERT_TRUE(notes) << notes.error().message;
  EXPECT_EQ(notes->size(), 1U);
  const Solids seen = read_back(path_);
  EXPECT_TRUE(seen.valid);
  ASSERT_EQ(seen.solids, 1);
  const double expected = kPi * 16.0 * 1e3 * tube.length_m;
  EXPECT_NEAR(seen.adaptive_mm3[0], expected, 2e-3 * expected);
}

TEST_F(StepFile, ATubeWhoseRadiusVariesTapersInTheFileToo) {
  Tube tube = free_tube(2, false);
  double expected = 0.0;
  for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) {
    tube.node_radius_m.push_back(0.003 +
                                 0.002 * static_cast<double>(i) / static_cast<double>(tube.centerline_m.size() - 1));
    if (i == 0) continue;
    const double mean_mm = 500.0 * (tube.node_radius_m[i - 1] + tube.node_radius_m[i]);
    expected += kPi * mean_mm * mean_mm * 1e3 * (tube.centerline_m[i] - tube.centerline_m[i - 1]).norm();
  }
  const auto notes = write_step(path_, std::vector{tube});
  ASSERT_TRUE(notes) << notes.error().message;
  EXPECT_THAT(*notes, ElementsAre(HasSubstr("as thick as they are")));
  const Solids seen = read_back(path_);
  EXPECT_TRUE(seen.valid);
  ASSERT_EQ(seen.solids, 1);
  EXPECT_NEAR(seen.adaptive_mm3[0], expected, 1e-3 * expected);
}

TEST_F(StepFile, ATableThatIsNotAsLongAsItsTubeGivesWayToTheNodes) {
  PartChain straight;
  straight.closing_m = 0.1;
  Tube tube = free_tube(3, false);  // a helix that was called straight
  tube.bend_table = bend_table_of({straight, {}, 0.0});
  const auto notes = write_step(path_, std::vector{tube});
  ASSERT_TRUE(notes) << notes.error().message;
  EXPECT_THAT(*notes, ElementsAre(HasSubstr("a spline surface")));
  const Solids seen = read_back(path_);
  ASSERT_EQ(seen.solids, 1);
  const double expected = kPi * 16.0 * 1e3 * tube.length_m;
  EXPECT_NEAR(seen.adaptive_mm3[0], expected, 1e-3 * expected);
}

TEST_F(StepFile, EqualTubesGiveEqualBytes) {
  ASSERT_TRUE(write_step(path_, std::vector{tube_of(1, bent_chain()), free_tube(2, true)}));
  const std::string first = text_of(path_);
  ASSERT_TRUE(write_step(folder_ / "again.step", std::vector{tube_of(1, bent_chain()), free_tube(2, true)}));
  EXPECT_EQ(text_of(folder_ / "again.step"), first);
}

TEST_F(StepFile, WhatMakesNoSolidIsLeftOutAndSaid) {
  Tube point;
  point.id = 4;
  point.radius_m = 0.01;
  point.centerline_m = {{0.0, 0.0, 0.5}};
  Tube folded = free_tube(5, false);
  folded.radius_m = 0.3;  // above the line's own radius: it would be swept through itself
  Tube unknown = free_tube(6, false);
  unknown.radius_m = std::nan("");
  const auto some = write_step(path_, std::vector{point, tube_of(1, bent_chain()), folded, unknown});
  ASSERT_TRUE(some) << some.error().message;
  ASSERT_EQ(some->size(), 3U);
  for (const std::string& note : *some) EXPECT_THAT(note, HasSubstr("is left out: "));
  EXPECT_EQ(read_back(path_).solids, 1);
  const auto none = write_step(path_, std::vector{point});
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message, HasSubstr("tubes.step: nothing to write: tube 4: is left out"));
  EXPECT_FALSE(write_step(path_, {}));
  const auto nowhere = write_step("/nowhere/a.step", std::vector{tube_of(1, bent_chain())});
  ASSERT_FALSE(nowhere);
  EXPECT_THAT(nowhere.error().message, HasSubstr("/nowhere/a.step: can't be written"));
}

}  // namespace
}  // namespace tubetrack

#endif
