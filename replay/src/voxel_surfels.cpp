#include <Eigen/Geometry>
#include <cmath>

#include "grid_surfels.hpp"
#include "point_tree.hpp"
#include "voronoi_normals.hpp"

namespace tubetrack {

namespace {

/// The six faces of a voxel: half the way to the neighbour, and the area vector that way.
struct FaceShape {
  Eigen::Vector3i step;
  Eigen::Vector3d to_center_m;
  Eigen::Vector3d outward_area_m2;
};

std::array<FaceShape, 6> face_shapes(const Eigen::Matrix3d& axes_m) {
  std::array<FaceShape, 6> shapes;
  std::size_t next = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d way_m = axes_m.col(axis);
    Eigen::Vector3d area_m2 = axes_m.col((axis + 1) % 3).cross(axes_m.col((axis + 2) % 3));
    if (area_m2.dot(way_m) < 0.0) area_m2 = -area_m2;  // the axes may be left-handed
    for (const int sign : {-1, 1})
      shapes[next++] = {sign * Eigen::Vector3i::Unit(axis), 0.5 * sign * way_m, sign * area_m2};
  }
  return shapes;
}

}  // namespace

std::vector<BoundaryFace> boundary_faces(const VoxelGrid& grid) {
  const auto shapes = face_shapes(grid.axes_m);
  std::vector<BoundaryFace> faces;
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      for (int i = 0; i < grid.size.x(); ++i) {
        if (grid.inside[grid.at(i, j, k)] == 0) continue;
        for (const FaceShape& shape : shapes) {
          const Eigen::Vector3i next = Eigen::Vector3i(i, j, k) + shape.step;
          if (!grid.contains(next.x(), next.y(), next.z())) continue;
          if (grid.inside[grid.at(next.x(), next.y(), next.z())] != 0) continue;
          const Eigen::Vector3d voxel_m = grid.origin_m + grid.axes_m * Eigen::Vector3d(i, j, k);
          faces.push_back({voxel_m + shape.to_center_m, shape.outward_area_m2});
        }
      }
    }
  }
  return faces;
}

std::vector<Eigen::Vector3f> smoothed_normals(const std::vector<BoundaryFace>& faces, double radius_m) {
  std::vector<Eigen::Vector3d> centers;
  centers.reserve(faces.size());
  for (const BoundaryFace& face : faces) centers.push_back(face.center_m);
  const PointTree tree(centers);
  const double sigma_m = 0.5 * radius_m;
  std::vector<Eigen::Vector3f> normals;
  normals.reserve(faces.size());
  std::vector<Neighbour> near;
  for (const BoundaryFace& face : faces) {
    tree.within(face.center_m, radius_m, near);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Neighbour& one : near) {
      const double weight = std::exp(-0.5 * one.squared_distance / (sigma_m * sigma_m));
      sum += weight * faces[one.index].outward_area_m2;
    }
    // Opposite sides of a plate thinner than the ball cancel out; then the face's own normal has to do.
    const bool cancelled = !(sum.norm() > 1e-6 * face.outward_area_m2.norm());
    normals.push_back((cancelled ? face.outward_area_m2 : sum).normalized().cast<float>());
  }
  return normals;
}

namespace {

std::vector<Eigen::Vector3f> voronoi_normals_of(const std::vector<BoundaryFace>& faces, double step_m,
                                                double radius_m) {
  std::vector<Eigen::Vector3d> centers_m, outward;
  for (const BoundaryFace& face : faces) {
    centers_m.push_back(face.center_m);
    outward.push_back(face.outward_area_m2);
  }
  return voronoi_normals(centers_m, outward, {step_m, kVoronoiOffset * radius_m, kVoronoiRadius * radius_m});
}

}  // namespace

void add_voxel_surfels(const VoxelGrid& grid, const Surfel& pattern, const NormalWindow& window,
                       std::vector<Surfel>& surfels) {
  const std::vector<BoundaryFace> faces = boundary_faces(grid);
  if (faces.empty()) return;
  const double step_m = std::cbrt(std::abs(grid.axes_m.determinant()));
  const std::vector<Eigen::Vector3f> normals = window.method == GridNormals::voronoi
                                                   ? voronoi_normals_of(faces, step_m, window.radius_m)
                                                   : smoothed_normals(faces, window.radius_m);
  const double step_area = step_m * step_m;
  surfels.reserve(faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    Surfel surfel = pattern;
    surfel.position_m = faces[i].center_m.cast<float>();
    surfel.inward_normal = -normals[i];
    const double seen = faces[i].outward_area_m2.dot(normals[i].cast<double>()) / step_area;
    surfel.weight = static_cast<float>(std::max(0.0, seen));
    surfel.cell = static_cast<std::uint32_t>(i);
    surfels.push_back(surfel);
  }
}

}  // namespace tubetrack
