#include "paper_scans.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "scan_bodies.hpp"

namespace tubetrack::bench {

namespace {

constexpr double kStep_m = 0.001;
using std::numbers::pi;

/// A tube that goes on in bends of 90° and less, alternately to either side and up and down, so that it nowhere meets
/// itself, as long as asked for.
PartChain long_tube(double length_m, double radius_m, bool flat) {
  PartChain chain;
  chain.start_m = {0.05, 0.05, 0.0};
  chain.direction = Eigen::Vector3d::UnitX();
  chain.towards = Eigen::Vector3d::UnitY();
  const double straight_m = 12.0 * radius_m, bend_radius_m = 5.0 * radius_m, angle_rad = 0.4 * pi;
  // Around and back, and then on: + − − +, in planes that lie slightly askew at first; they would lead a long tube back
  // to itself.
  constexpr std::size_t kAskew = 16;
  const double turns[] = {0.0, pi, 0.0, pi};
  double left_m = length_m;
  for (std::size_t i = 0; left_m > 2.0 * straight_m + bend_radius_m * angle_rad; ++i) {
    const double askew_rad = flat || i >= kAskew ? 0.0 : (i % 4 == 1 ? 0.3 : i % 4 == 3 ? -0.3 : 0.0);
    chain.bends.push_back({straight_m, turns[i % 4] + askew_rad, angle_rad, bend_radius_m});
    left_m -= straight_m + bend_radius_m * angle_rad;
  }
  chain.closing_m = left_m;
  return chain;
}

/// A mesh whose radius is 6 steps, with points off by `noise` steps.
PaperScan mesh(const std::string& name, double faces, double section_rad, double noise, std::size_t paper_faces,
               double paper_s, double goal_voxels) {
  PaperScan row;
  row.name = name;
  row.radius_m = 6.0 * kStep_m;
  ScanOfTube how{row.radius_m, kStep_m};
  how.section_rad = section_rad;
  how.noise_m = noise * kStep_m;
  const double around = std::lround(section_rad * row.radius_m / kStep_m);
  row.truth = long_tube(faces / (2.0 * around) * kStep_m, row.radius_m, section_rad < 6.0);
  std::mt19937_64 random(static_cast<std::uint64_t>(faces));
  row.scan = mesh_of_tube(row.truth, how, random);
  row.paper_faces = paper_faces;
  row.paper_s = paper_s;
  row.goal_voxels = goal_voxels;
  return row;
}

PaperScan digital_object(double times) {
  PaperScan row;
  row.name = "digital object";
  row.radius_m = 4.9 * kStep_m;
  // A digitised tube has 1.5 boundary faces for a voxel face of its surface.
  row.truth = long_tube(times * 60'768.0 / (1.5 * 2.0 * pi * 4.9) * kStep_m, row.radius_m, false);
  row.scan = voxels_of_tube(row.truth, {row.radius_m, kStep_m});
  row.paper_faces = 60'768;
  row.paper_s = 6.91;
  row.goal_voxels = 0.3;
  return row;
}

/// A tube on a floor, one radius above it, cells around it filled up to as many as asked for.
PaperScan height_map(double times) {
  PaperScan row;
  row.name = "height map";
  row.radius_m = 8.0 * kStep_m;
  row.truth = long_tube(std::sqrt(times) * 1.2, row.radius_m, true);
  row.scan = heights_of_tube(row.truth, {row.radius_m, kStep_m});
  HeightGrid& grid = row.scan.heights;
  HeightGrid whole = grid;
  whole.height = std::max(grid.height, static_cast<int>(times * 645'450.0 / grid.width));
  const auto floor = static_cast<float>(-row.radius_m);
  whole.height_m.assign(static_cast<std::size_t>(whole.width) * static_cast<std::size_t>(whole.height), floor);
  for (std::size_t i = 0; i < grid.height_m.size(); ++i) whole.height_m[i] = std::fmax(grid.height_m[i], floor);
  grid = std::move(whole);
  row.paper_faces = 645'450;
  row.paper_s = 22.33;
  row.goal_voxels = 0.3;
  return row;
}

}  // namespace

std::vector<PaperScan> paper_scans(double times) {
  std::vector<PaperScan> rows;
  rows.push_back(mesh("full mesh", times * 151'444, 2.0 * pi, 0.0, 151'444, 6.23, 0.1));
  rows.push_back(mesh("partial mesh", times * 37'527, 0.9 * pi, 0.0, 37'527, 2.45, 0.2));
  rows.push_back(mesh("reduced scanned area", times * 52'914, 0.8 * pi, 0.0, 52'914, 4.36, 0.2));
  rows.push_back(digital_object(times));
  rows.push_back(height_map(times));
  rows.push_back(mesh("decomposition", times * 187'638, 2.0 * pi, 0.0, 187'638, 12.17, 0.1));
  return rows;
}

std::vector<PaperScan> robustness_scans(double times) {
  std::vector<PaperScan> rows;
  rows.push_back(mesh("noise of 0.2 steps", times * 50'000, 2.0 * pi, 0.2, 0, 0.0, 0.1));
  rows.push_back(mesh("holes: three faces in ten", times * 50'000, 2.0 * pi, 0.0, 0, 0.0, 0.1));
  Scan& holes = rows.back().scan;
  std::vector<std::array<std::uint32_t, 3>> kept;
  // Holes of a hundred faces or so: by where the face lies along and around.
  for (std::size_t i = 0; i < holes.faces.size(); ++i) {
    std::mt19937 random(static_cast<unsigned>(i / 760 * 131 + i % 76 / 15));
    if (random() % 10 >= 3) kept.push_back(holes.faces[i]);
  }
  holes.faces = std::move(kept);
  rows.push_back(mesh("sector of 130°", times * 50'000, 130.0 / 180.0 * pi, 0.0, 0, 0.0, 0.2));
  PaperScan coarse;
  coarse.name = "low resolution: radius of 2 steps";
  coarse.radius_m = 2.0 * kStep_m;
  coarse.truth = long_tube(times * 5'000 / 26.0 * kStep_m, coarse.radius_m, false);
  std::mt19937_64 random(9);
  coarse.scan = mesh_of_tube(coarse.truth, {coarse.radius_m, kStep_m}, random);
  coarse.goal_voxels = 0.1;
  rows.push_back(std::move(coarse));
  return rows;
}

PaperScan mesh_of_faces(std::size_t faces) {
  return mesh("full mesh", static_cast<double>(faces), 2.0 * pi, 0.0, 0, 0.0, 0.1);
}

std::size_t faces_of(const Scan& scan, std::size_t surfels) {
  return scan.kind == ScanKind::mesh ? scan.faces.size() : surfels;
}

}  // namespace tubetrack::bench
