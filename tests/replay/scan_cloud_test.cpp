#include <fmt/format.h>
#include <gmock/gmock.h>
#include <liblzf/lzf.h>

#include <cmath>
#include <numbers>

#include "scan_files.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using std::numbers::pi;
using Points = std::vector<Eigen::Vector3d>;

std::string xyz_text(const Points& points) {
  std::string text;
  for (const auto& p : points) text += fmt::format("{} {} {}\n", p.x(), p.y(), p.z());
  return text;
}

std::string pcd_header(std::size_t count, const std::string& data, bool normals, std::size_t rows = 1) {
  return fmt::format(
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb{}\nSIZE 4 4 4 4{}\nTYPE F F F U{}\nCOUNT 1 1 1 1{}\n"
      "WIDTH {}\nHEIGHT {}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA {}\n",
      normals ? " normal_x normal_y normal_z" : "", normals ? " 4 4 4" : "", normals ? " F F F" : "",
      normals ? " 1 1 1" : "", count / rows, rows, count, data);
}

/// ascii, binary or binary_compressed, with or without the normals of `piece`.
std::string pcd_bytes(const Points& points, const std::string& data, const TorusPiece* piece = nullptr,
                      std::size_t rows = 1) {
  std::string bytes = pcd_header(points.size(), data, piece != nullptr, rows);
  std::vector<std::string> columns(piece != nullptr ? 7 : 4);
  for (const auto& p : points) {
    const Eigen::Vector3d n = piece != nullptr ? torus_normal(*piece, p) : Eigen::Vector3d::Zero();
    if (data == "ascii") {
      bytes += fmt::format("{} {} {} 4278190080", p.x(), p.y(), p.z());
      bytes += piece != nullptr ? fmt::format(" {} {} {}\n", n.x(), n.y(), n.z()) : "\n";
      continue;
    }
    const std::array<double, 7> values = {p.x(), p.y(), p.z(), 0.0, n.x(), n.y(), n.z()};
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const std::string number = float_bytes(static_cast<float>(values[k]));
      if (data == "binary") bytes += number;
      columns[k] += number;
    }
  }
  if (data != "binary_compressed") return bytes;
  std::string all;
  for (const std::string& column : columns) all += column;
  std::string packed(all.size() * 2 + 64, '\0');
  packed.resize(
      lzf_compress(all.data(), static_cast<unsigned>(all.size()), packed.data(), static_cast<unsigned>(packed.size())));
  return bytes + uint32_bytes(static_cast<std::uint32_t>(packed.size())) +
         uint32_bytes(static_cast<std::uint32_t>(all.size())) + packed;
}

struct NormalErrors {
  double mean_deg = 0.0;
  double outward_part = 0.0;  ///< of the signs
};
NormalErrors normal_errors(const Scan& scan, const TorusPiece& piece) {
  NormalErrors errors;
  for (std::size_t i = 0; i < scan.points_m.size(); ++i) {
    const double cosine = scan.normals[i].cast<double>().dot(torus_normal(piece, 1000.0 * scan.points_m[i]));
    errors.mean_deg += std::acos(std::min(1.0, std::abs(cosine))) * 180.0 / pi;
    errors.outward_part += cosine > 0.0 ? 1.0 : 0.0;
  }
  errors.mean_deg /= static_cast<double>(scan.points_m.size());
  errors.outward_part /= static_cast<double>(scan.points_m.size());
  return errors;
}

TEST(CloudScan, EveryFormatGivesTheSamePoints) {
  const TemporaryFolder folder;
  const TorusPiece piece;
  const Points points = torus_points(piece, 5000, 0.0, 1);
  write_bytes(folder / "a.xyz", "\xEF\xBB\xBF" + xyz_text(points));
  std::string text = "//X Y Z\n5000\n";
  for (const auto& p : points) text += fmt::format("{:.9f};{:.9f};{:.9f}\r\n", p.x(), p.y(), p.z());
  write_bytes(folder / "semicolons.txt", text);
  text = "x, y, z\n";
  for (const auto& p : points) text += fmt::format("{:.9f}, {:.9f}, {:.9f}\n", p.x(), p.y(), p.z());
  write_bytes(folder / "commas.txt", text);
  write_bytes(folder / "text.pcd", pcd_bytes(points, "ascii"));
  write_bytes(folder / "binary.pcd", pcd_bytes(points, "binary"));
  write_bytes(folder / "compressed.pcd", pcd_bytes(points, "binary_compressed"));
  write_bytes(folder / "text.ply", ply_bytes({points, {}}, "ascii"));
  write_bytes(folder / "little.ply", ply_bytes({points, {}}, "binary_little_endian"));
  for (const char* name : {"a.xyz", "semicolons.txt", "commas.txt", "text.pcd", "binary.pcd", "compressed.pcd",
                           "text.ply", "little.ply"}) {
    SCOPED_TRACE(name);
    const Scan scan = scan_of(folder / name);
    EXPECT_EQ(scan.kind, ScanKind::cloud);
    ASSERT_EQ(scan.points_m.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) ASSERT_LT((scan.points_m[i] - 0.001 * points[i]).norm(), 1e-8);
    EXPECT_EQ(normal_errors(scan, piece).outward_part, 1.0);
  }
}

TEST(CloudScan, NormalsOfTheFileAreTakenAndTurnedOutward) {
  const TemporaryFolder folder;
  const TorusPiece piece;
  Points points = torus_points(piece, 5000, 0.0, 2);
  write_bytes(folder / "a.pcd", pcd_bytes(points, "binary_compressed", &piece));
  const Scan outward = scan_of(folder / "a.pcd");
  EXPECT_LT(normal_errors(outward, piece).mean_deg, 0.01);
  EXPECT_EQ(normal_errors(outward, piece).outward_part, 1.0);
  EXPECT_THAT(outward.notes, IsEmpty());

  std::string inward, mixed, coloured;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d &p = points[i], n = torus_normal(piece, p);
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    inward += fmt::format("{} {} {} {} {} {}\n", p.x(), p.y(), p.z(), -n.x(), -n.y(), -n.z());
    mixed += fmt::format("{} {} {} {} {} {}\n", p.x(), p.y(), p.z(), sign * n.x(), sign * n.y(), sign * n.z());
    coloured += fmt::format("{} {} {} 255 0 {} {} {} {}\n", p.x(), p.y(), p.z(), i % 256, n.x(), n.y(), n.z());
  }
  write_bytes(folder / "inward.xyz", inward);
  write_bytes(folder / "mixed.xyz", mixed);
  write_bytes(folder / "coloured.xyz", coloured);
  for (const char* name : {"inward.xyz", "mixed.xyz", "coloured.xyz"}) {
    SCOPED_TRACE(name);
    const Scan scan = scan_of(folder / name);
    EXPECT_LT(normal_errors(scan, piece).mean_deg, 0.1);
    EXPECT_EQ(normal_errors(scan, piece).outward_part, 1.0);
  }
  EXPECT_THAT(scan_of(folder / "inward.xyz").notes, Contains(HasSubstr("looked inward: turned")));
  EXPECT_THAT(scan_of(folder / "mixed.xyz").notes, Contains(HasSubstr("point opposite ways")));
}

TEST(CloudScan, NormalsOfNoisyPartialCloudsAreEstimatedAndTurnedOutward) {
  struct Case {
    const char* name;
    TorusPiece piece;
    int count;
    double noise;
    double max_deg;
  };
  const TemporaryFolder folder;
  for (const Case& one :
       {Case{"whole, clean", {60, 10, 3, 2 * pi}, 20'000, 0.0, 1.5},
        Case{"whole, noisy", {60, 10, 3, 2 * pi}, 20'000, 0.1, 5.0},
        Case{"from one side", {60, 10, 3, pi}, 20'000, 0.1, 6.0}, Case{"a third", {60, 10, 3, 2.1}, 20'000, 0.1, 7.0},
        Case{"sparse", {60, 10, 3, 2 * pi}, 1500, 0.05, 8.0}}) {
    SCOPED_TRACE(one.name);
    write_bytes(folder / "a.xyz", xyz_text(torus_points(one.piece, one.count, one.noise, 3)));
    const Scan scan = scan_of(folder / "a.xyz");
    const NormalErrors errors = normal_errors(scan, one.piece);
    std::printf("%-14s %6d points, noise %.2f mm, step %.2f mm: normals %.2f deg off, %.4f outward\n", one.name,
                one.count, one.noise, 1000.0 * scan.grid_step_m, errors.mean_deg, errors.outward_part);
    EXPECT_LT(errors.mean_deg, one.max_deg);
    EXPECT_GT(errors.outward_part, 0.999);
  }
}

TEST(CloudScan, RepeatedAndMissingPointsGo) {
  const TemporaryFolder folder;
  Points points = torus_points({}, 1000, 0.0, 4);
  const Points once = points;
  points.insert(points.end(), once.begin(), once.end());
  for (int i = 0; i < 200; ++i) points.emplace_back(std::nan(""), std::nan(""), std::nan(""));
  write_bytes(folder / "a.pcd", pcd_bytes(points, "binary"));
  const Scan scan = scan_of(folder / "a.pcd");
  EXPECT_EQ(scan.points_m.size(), 1000U);
  EXPECT_THAT(scan.notes, Contains(HasSubstr("200 of 2200 points are not finite")));
  EXPECT_THAT(scan.notes, Contains(HasSubstr("1000 of 2200 points repeat another one")));
}

TEST(CloudScan, AThousandTimesTheSamePointIsNoCloud) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.xyz", xyz_text(Points(1000, Eigen::Vector3d(1, 2, 3))));
  EXPECT_THAT(refusal_of(folder / "a.xyz"), HasSubstr("1 different finite points, takes at least 3"));
  Points line;
  for (int i = 0; i < 100; ++i) line.emplace_back(i, 0, 0);
  write_bytes(folder / "line.xyz", xyz_text(line));
  for (const Eigen::Vector3f& normal : scan_of(folder / "line.xyz").normals) ASSERT_NEAR(normal.norm(), 1.0F, 1e-5F);
}

TEST(CloudScan, ASensorsFrameIsTurnedTowardTheSensor) {
  const TemporaryFolder folder;
  Points points;  // a plane and a hollow: no votes could tell
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 40; ++u) points.emplace_back(u - 20.0, v - 20.0, 100.0 - 0.02 * ((u - 20) * (u - 20)));
  }
  write_bytes(folder / "a.pcd", pcd_bytes(points, "ascii", nullptr, 40));
  for (const ScanSurfel& surfel : surfels_of(scan_of(folder / "a.pcd"))) ASSERT_GT(surfel.inward_normal.z(), 0.0F);
}

TEST(CloudScan, SpacingIsTheMedianNearestNeighbour) {
  const TemporaryFolder folder;
  Points points;
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 40; ++u) points.emplace_back(1.5 * u, 2.0 * v, 0.0);
  }
  write_bytes(folder / "a.xyz", xyz_text(points));
  const Scan scan = scan_of(folder / "a.xyz");
  EXPECT_NEAR(scan.grid_step_m, 0.0015, 1e-12);
  EXPECT_THAT(scan.notes, Contains(HasSubstr("inside and outside could not be told for 1600 of 1600")));
}

}  // namespace
}  // namespace tubetrack
