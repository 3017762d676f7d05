#include "holed_tube.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "found_tubes.hpp"
#include "markdown.hpp"
#include "paper_table.hpp"
#include "scan_bodies.hpp"
#include "thinning.hpp"
#include "tubetrack/replay/scan_surfels.hpp"
#include "tubetrack/report/scan_picture.hpp"
#include "tubetrack/report/surface_mesh.hpp"

namespace tubetrack::bench {

namespace {

constexpr double kVoxel_m = 0.001;
constexpr double kPictured = 0.05, kHole_voxels = 1.5;

/// Voxels as cubes.
SurfaceMesh cubes_of(const VoxelGrid& grid, const std::array<std::uint8_t, 3>& color) {
  SurfaceMesh mesh;
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      for (int i = 0; i < grid.size.x(); ++i) {
        if (grid.inside[grid.at(i, j, k)] == 0) continue;
        for (int side = 0; side < 6; ++side) {
          const int axis = side / 2, sign = side % 2 == 0 ? -1 : 1;
          const Eigen::Vector3i next = Eigen::Vector3i(i, j, k) + sign * Eigen::Vector3i::Unit(axis);
          if (grid.contains(next.x(), next.y(), next.z()) && grid.inside[grid.at(next.x(), next.y(), next.z())] != 0)
            continue;
          const Eigen::Vector3d middle = Eigen::Vector3d(i, j, k) + 0.5 * sign * Eigen::Vector3d::Unit(axis);
          const Eigen::Vector3d a = 0.5 * Eigen::Vector3d::Unit((axis + 1) % 3),
                                b = 0.5 * Eigen::Vector3d::Unit((axis + 2) % 3);
          const auto first = static_cast<std::uint32_t>(mesh.points_m.size());
          for (const Eigen::Vector3d& corner :
               {Eigen::Vector3d(-a - b), Eigen::Vector3d(a - b), Eigen::Vector3d(a + b), Eigen::Vector3d(b - a)}) {
            mesh.points_m.emplace_back(grid.origin_m + grid.axes_m * (middle + corner));
            mesh.colors.push_back(color);
          }
          mesh.faces.push_back({first, first + 1, first + 2});
          mesh.faces.push_back({first, first + 2, first + 3});
        }
      }
    }
  }
  return mesh;
}

/// RMS distance of the voxels of a skeleton from the true centreline, in voxels.
LineError skeleton_error(const VoxelGrid& skeleton, const PartChain& truth) {
  std::vector<Eigen::Vector3d> places_m;
  for (int k = 0; k < skeleton.size.z(); ++k) {
    for (int j = 0; j < skeleton.size.y(); ++j) {
      for (int i = 0; i < skeleton.size.x(); ++i) {
        if (skeleton.inside[skeleton.at(i, j, k)] != 0)
          places_m.emplace_back(skeleton.origin_m + skeleton.axes_m * Eigen::Vector3d(i, j, k));
      }
    }
  }
  return error_of(places_m, truth);
}

}  // namespace

PaperScan holed_tube(double part, double hole_voxels) {
  PaperScan row;
  row.name = part > 0.0 ? number(100.0 * part, 0) + " % of it holes" : "whole";
  row.radius_m = 4.9 * kVoxel_m;
  row.truth.start_m = {0.01, 0.01, 0.01};
  row.truth.direction = Eigen::Vector3d(1.0, 0.3, 0.2).normalized();
  row.truth.towards = row.truth.direction.unitOrthogonal();
  row.truth.bends = {{14.0 * row.radius_m, 0.0, 1.7, 5.0 * row.radius_m},
                     {9.0 * row.radius_m, 0.6, 1.5, 5.0 * row.radius_m}};
  row.truth.closing_m = 14.0 * row.radius_m;
  row.scan = voxels_of_tube(row.truth, {row.radius_m, kVoxel_m});
  row.goal_voxels = 0.3;
  VoxelGrid& grid = row.scan.voxels;
  std::vector<std::size_t> body;
  for (std::size_t i = 0; i < grid.inside.size(); ++i) {
    if (grid.inside[i] != 0) body.push_back(i);
  }
  std::mt19937_64 random(2015);
  const auto asked = static_cast<std::size_t>(part * static_cast<double>(body.size()));
  const int reach = static_cast<int>(hole_voxels);
  for (std::size_t taken = 0; taken < asked;) {
    const auto middle = static_cast<int>(body[random() % body.size()]);
    const int u = middle % grid.size.x(), v = middle / grid.size.x() % grid.size.y(),
              w = middle / grid.size.x() / grid.size.y();
    for (int k = -reach; k <= reach; ++k) {
      for (int j = -reach; j <= reach; ++j) {
        for (int i = -reach; i <= reach; ++i) {
          if (i * i + j * j + k * k > hole_voxels * hole_voxels || !grid.contains(u + i, v + j, w + k)) continue;
          taken += std::exchange(grid.inside[grid.at(u + i, v + j, w + k)], std::uint8_t{0});
        }
      }
    }
  }
  return row;
}

std::string holed_tubes_text() {
  MarkdownTable table({"tube", "method", "RMS to truth, voxels", "goal", "largest, voxels", "pieces", "ends", "loops",
                       "cavities", "length found", "seconds"});
  for (const double part : {0.0, 0.01, kPictured}) {
    const PaperScan scan = holed_tube(part, kHole_voxels);
    const std::clock_t begin = std::clock();
    const VoxelGrid skeleton = thinned(scan.scan.voxels);
    const double thinning_s = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    const Topology topology = topology_of(skeleton);
    const LineError thinning = skeleton_error(skeleton, scan.truth);
    table.add({scan.name, "thinning", number(thinning.rms_m / kVoxel_m, 2), "–", number(thinning.max_m / kVoxel_m, 1),
               std::to_string(topology.pieces), std::to_string(topology.ends), std::to_string(topology.loops),
               std::to_string(topology.cavities), "–", number(thinning_s, 2)});
    const std::clock_t ours_begin = std::clock();
    const TubeFrame frame = found_tubes(scan.scan, surfels_of(scan.scan));
    const double ours_s = static_cast<double>(std::clock() - ours_begin) / CLOCKS_PER_SEC;
    double found = 0.0;
    for (const Tube& tube : frame.tubes) found += tube.length_m / length_of(scan.truth);
    const LineError ours = frame.tubes.empty() ? LineError{std::nan(""), std::nan("")}
                                               : error_of(frame.tubes.front().centerline_m, scan.truth);
    table.add({scan.name, "ours", at_most(ours.rms_m / kVoxel_m, scan.goal_voxels, 1.0, 3),
               "≤ " + number(scan.goal_voxels, 1), number(ours.max_m / kVoxel_m, 2), std::to_string(frame.tubes.size()),
               std::to_string(2 * frame.tubes.size()), "0", "0", number(found, 3), number(ours_s, 2)});
  }
  return table.text();
}

Expected<void> write_holed_tube_picture(const std::filesystem::path& path) {
  const PaperScan scan = holed_tube(kPictured, kHole_voxels);
  SurfaceMesh panels[3];
  panels[0] = cubes_of(scan.scan.voxels, {170, 170, 170});
  panels[1] = cubes_of(thinned(scan.scan.voxels), {200, 60, 50});
  for (Tube tube : found_tubes(scan.scan, surfels_of(scan.scan)).tubes) {
    tube.radius_m = 0.6 * kVoxel_m;
    tube.node_radius_m.clear();
    append(panels[2], surface_of(tube));
  }
  return write_scan_picture(path, panels);
}

}  // namespace tubetrack::bench
