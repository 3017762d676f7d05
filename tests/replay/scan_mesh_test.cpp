#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "scan_files.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using std::numbers::pi;

/// Part of the surfels whose normals point toward the torus' centreline; the piece is in mm.
double inward_part(const Scan& scan, const TorusPiece& piece) {
  const auto surfels = surfels_of(scan);
  const auto inward = std::count_if(surfels.begin(), surfels.end(), [&](const ScanSurfel& surfel) {
    const Eigen::Vector3d normal = surfel.inward_normal.cast<double>();
    return normal.dot(torus_normal(piece, 1000.0 * (surfel.position_m.cast<double>() + scan.origin_m))) < -0.5;
  });
  return static_cast<double>(inward) / static_cast<double>(surfels.size());
}

TEST(MeshScan, EveryFormatGivesTheSameMesh) {
  const TemporaryFolder folder;
  const TorusPiece piece;
  const TestMesh mesh = tube_mesh(piece);
  write_bytes(folder / "a.off", off_text(mesh));
  write_bytes(folder / "a.obj", obj_text(mesh));
  write_bytes(folder / "text.stl", ascii_stl(mesh));
  write_bytes(folder / "binary.stl", binary_stl(mesh));
  write_bytes(folder / "solid.STL", binary_stl(mesh, "solid, though binary, and with a facet"));
  write_bytes(folder / "text.ply", ply_bytes(mesh, "ascii"));
  write_bytes(folder / "little.ply", ply_bytes(mesh, "binary_little_endian"));
  write_bytes(folder / "big.ply", ply_bytes(mesh, "binary_big_endian", true));
  for (const char* name :
       {"a.off", "a.obj", "text.stl", "binary.stl", "solid.STL", "text.ply", "little.ply", "big.ply"}) {
    SCOPED_TRACE(name);
    const Scan scan = scan_of(folder / name);
    EXPECT_EQ(scan.kind, ScanKind::mesh);
    ASSERT_EQ(scan.points_m.size(), mesh.points.size());
    ASSERT_EQ(scan.faces.size(), mesh.faces.size());
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3d expected = 0.001 * mesh.points[mesh.faces[i][k]];
        ASSERT_LT((scan.points_m[scan.faces[i][k]] - expected).norm(), 1e-8);
      }
    }
    EXPECT_EQ(inward_part(scan, piece), 1.0);
  }
}

TEST(MeshScan, UnitsComeOutInMetres) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.off", off_text(tube_mesh({})));
  ScanOptions options;
  const double as_millimetres = scan_of(folder / "a.off", options).points_m.front().norm();
  EXPECT_NEAR(as_millimetres, 0.050, 1e-9);  // the section starts on the inside of the bend
  options.unit = ScanUnit::metre;
  EXPECT_NEAR(scan_of(folder / "a.off", options).points_m.front().norm(), 50.0, 1e-6);
  options.unit = ScanUnit::voxel;
  EXPECT_NEAR(scan_of(folder / "a.off", options).points_m.front().norm(), 0.050, 1e-9);
  EXPECT_THAT(scan_of(folder / "a.off").notes, IsEmpty());
  TestMesh tiny = tube_mesh({});
  for (auto& point : tiny.points) point *= 0.001;
  write_bytes(folder / "metres.off", off_text(tiny));
  EXPECT_THAT(scan_of(folder / "metres.off").notes, Contains(HasSubstr("give --unit")));
}

TEST(MeshScan, GridStepIsTheMedianLongestEdgeAndForSliversTheShortest) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.off", "OFF\n4 2 0\n0 0 0\n3 0 0\n3 4 0\n0 4 0\n3 0 1 2\n3 0 2 3\n");
  EXPECT_NEAR(scan_of(folder / "a.off").grid_step_m, 0.005, 1e-12);
  write_bytes(folder / "cad.off", off_text(tube_mesh({1e4, 10.0, 0.05, 2 * pi, 1, 64})));
  const Scan slivers = scan_of(folder / "cad.off");  // 500 mm long, one face from end to end
  EXPECT_NEAR(slivers.grid_step_m, 2.0 * 0.010 * std::sin(pi / 64), 1e-5);
}

TEST(MeshScan, LargeFacesGiveManySurfelsOfTheSameArea) {
  const TemporaryFolder folder;
  write_bytes(folder / "cad.off", off_text(tube_mesh({1e4, 10.0, 0.05, 2 * pi, 1, 64})));
  const Scan scan = scan_of(folder / "cad.off");
  const auto surfels = surfels_of(scan);
  EXPECT_GT(surfels.size(), 10'000U);
  double area_m2 = 0.0;
  for (const ScanSurfel& surfel : surfels) area_m2 += surfel.weight * scan.grid_step_m * scan.grid_step_m;
  EXPECT_NEAR(area_m2, 2 * pi * 0.010 * 0.500, 0.005 * 2 * pi * 0.010 * 0.500);
  ScanSurfelOptions few;
  few.max_count = 2000;
  EXPECT_LE(surfels_of(scan, few).size(), 2000U);
}

TEST(MeshScan, RepeatedPointsAndFacesAndFacesWithoutAreaGo) {
  const TemporaryFolder folder;
  TestMesh mesh = tube_mesh({});
  const std::size_t points = mesh.points.size(), faces = mesh.faces.size();
  mesh.points.push_back(mesh.points[3]);
  mesh.points.emplace_back(1.0, 2.0, 3.0);  // of no face
  mesh.faces.push_back({3, static_cast<std::uint32_t>(points), 4});
  mesh.faces.push_back({mesh.faces[7][1], mesh.faces[7][2], mesh.faces[7][0]});
  mesh.faces.push_back({mesh.faces[8][1], mesh.faces[8][0], mesh.faces[8][2]});
  write_bytes(folder / "a.off", off_text(mesh));
  const Scan scan = scan_of(folder / "a.off");
  EXPECT_EQ(scan.points_m.size(), points);
  EXPECT_EQ(scan.faces.size(), faces);
  EXPECT_THAT(scan.notes, Contains(HasSubstr("1 of 5810 points repeat another one")));
  EXPECT_THAT(scan.notes, Contains(HasSubstr("1 of 11523 faces have no area")));
  EXPECT_THAT(scan.notes, Contains(HasSubstr("2 of 11523 faces are there twice")));
  EXPECT_THAT(scan.notes, Contains(HasSubstr("1 of 5810 points belong to no face")));
}

/// A piece of tube with a part of its faces turned over, written and read.
struct Turned {
  const char* name;
  TorusPiece piece;
  double part;
};
class Orientation : public ::testing::TestWithParam<Turned> {};

TEST_P(Orientation, IsPutRight) {
  const TemporaryFolder folder;
  const TorusPiece& piece = GetParam().piece;
  TestMesh mesh = tube_mesh(piece);
  std::mt19937 random(7);
  for (auto& face : mesh.faces) {
    if (static_cast<double>(random()) < GetParam().part * 4294967296.0) std::swap(face[0], face[1]);
  }
  write_bytes(folder / "a.off", off_text(mesh));
  const Scan scan = scan_of(folder / "a.off");
  EXPECT_EQ(inward_part(scan, piece), 1.0);
  if (GetParam().part > 0.0) {
    EXPECT_THAT(scan.notes, Contains(HasSubstr("turned over")));
  }
}

INSTANTIATE_TEST_SUITE_P(Tubes, Orientation,
                         ::testing::Values(Turned{"closed", {60, 10, 2 * pi, 2 * pi, 240, 40}, 0.0},
                                           Turned{"closed half", {60, 10, 2 * pi, 2 * pi, 240, 40}, 0.5},
                                           Turned{"closed all", {60, 10, 2 * pi, 2 * pi, 240, 40}, 1.0},
                                           Turned{"open", {60, 10, 3, 2 * pi, 120, 40}, 0.0},
                                           Turned{"open half", {60, 10, 3, 2 * pi, 120, 40}, 0.5},
                                           Turned{"open all", {60, 10, 3, 2 * pi, 120, 40}, 1.0},
                                           Turned{"a third of the section", {60, 10, 3, 2.1, 120, 16}, 0.0},
                                           Turned{"a third of the section, most", {60, 10, 3, 2.1, 120, 16}, 0.8},
                                           Turned{"a third of the section, all", {60, 10, 3, 2.1, 120, 16}, 1.0},
                                           Turned{"fine", {60, 10, 3, pi, 1000, 120}, 1.0},
                                           Turned{"straight, thin", {5000, 5, 0.2, pi, 700, 12}, 1.0}));

TEST(MeshScan, ANoisyPartialMeshIsTurnedAllTheSame) {
  const TemporaryFolder folder;
  // Faces of 0.5 mm and noise of 0.15 mm: their normals are 20 to 30 degrees off.
  const TorusPiece piece{60, 10, 3, 2.5, 400, 50};
  TestMesh mesh = tube_mesh(piece);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 0.15);
  for (auto& point : mesh.points) point += noise(random) * torus_normal(piece, point);
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    if (i % 3 != 0) std::swap(mesh.faces[i][0], mesh.faces[i][1]);
  }
  write_bytes(folder / "a.off", off_text(mesh));
  EXPECT_GT(inward_part(scan_of(folder / "a.off"), piece), 0.98);
}

TEST(MeshScan, ATubeOnAFloorIsToldFromTheFloor) {
  const TemporaryFolder folder;
  // Half a tube, its feet, and four times its area of floor, all turned over.
  TestMesh mesh = tube_mesh({60, 10, 3, pi, 240, 26});
  const auto first = static_cast<std::uint32_t>(mesh.points.size());
  for (std::uint32_t i = 0; i < 120; ++i) {
    for (std::uint32_t j = 0; j < 120; ++j) mesh.points.emplace_back(60.0, 1.2 * i - 72.0, 1.2 * j - 72.0);
  }
  for (std::uint32_t i = 0; i + 1 < 120; ++i) {
    for (std::uint32_t j = 0; j + 1 < 120; ++j) {
      const std::uint32_t a = first + 120 * i + j;
      mesh.faces.push_back({a, a + 120, a + 121});
      mesh.faces.push_back({a, a + 121, a + 1});
    }
  }
  for (auto& face : mesh.faces) std::swap(face[0], face[1]);
  write_bytes(folder / "a.off", off_text(mesh));
  const Scan scan = scan_of(folder / "a.off");
  EXPECT_THAT(scan.notes, Contains(HasSubstr("faces looked inward: turned over")));
  EXPECT_GT(inward_part(scan, {}), 0.25);  // the floor has no inside: it went with the tube
}

TEST(MeshScan, AMoebiusStripIsReadAndNoted) {
  const TemporaryFolder folder;
  TestMesh mesh;
  constexpr std::uint32_t n = 40;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double turn = 2 * pi * i / n;
    const Eigen::Vector3d out(std::cos(turn), std::sin(turn), 0.0);
    const Eigen::Vector3d across = 5.0 * (std::cos(0.5 * turn) * out + std::sin(0.5 * turn) * Eigen::Vector3d::UnitZ());
    mesh.points.push_back(30.0 * out + across);
    mesh.points.push_back(30.0 * out - across);
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const bool last = i + 1 == n;
    const std::uint32_t a = 2 * i, b = a + 1, c = last ? 1 : a + 2, d = last ? 0 : a + 3;
    mesh.faces.push_back({a, c, b});
    mesh.faces.push_back({b, c, d});
  }
  write_bytes(folder / "a.off", off_text(mesh));
  EXPECT_THAT(scan_of(folder / "a.off").notes, Contains(HasSubstr("cannot agree")));
}

TEST(MeshScan, GeoreferencedCoordinatesKeepTheirDigits) {
  const TemporaryFolder folder;
  TestMesh mesh = tube_mesh({});
  for (auto& point : mesh.points) point += Eigen::Vector3d(4.5e8, 5.4e9, 2e5);
  write_bytes(folder / "far.off", off_text(mesh));
  const Scan scan = scan_of(folder / "far.off");
  EXPECT_THAT(scan.notes, Contains(HasSubstr("coordinates are large: moved by")));
  TorusPiece piece;
  const auto surfels = surfels_of(scan);
  for (const ScanSurfel& surfel : surfels) {
    const Eigen::Vector3d back_mm =
        1000.0 * (surfel.position_m.cast<double>() + scan.origin_m) - Eigen::Vector3d(4.5e8, 5.4e9, 2e5);
    const double flat = std::hypot(back_mm.x(), back_mm.y()) - piece.bend_radius;
    ASSERT_NEAR(std::hypot(flat, back_mm.z()), piece.radius, 0.05);
  }
}

TEST(MeshScan, PolygonsAreCutAndColoursPassedOver) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.off",
              "COFF 5 1 0\n0 0 0 255 0 0 255\n4 0 0 1 1 1 1\n5 3 0 0 0 0 0\n2 5 0 0 0 0 0\n-1 3 0 0 0 0 0\n"
              "5 0 1 2 3 4 0.1 0.2 0.3\n");
  EXPECT_EQ(scan_of(folder / "a.off").faces.size(), 3U);
}

}  // namespace
}  // namespace tubetrack
