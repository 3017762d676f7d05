#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "tubetrack/heightmap/height_map.hpp"
#include "tubetrack/heightmap/surfel.hpp"
#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {

inline const Intrinsics kVga{640, 480, 570.0, 570.0, 319.5, 239.5, {}};

/// A centreline's point and unit tangent.
struct AxisPoint {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d tangent = Eigen::Vector3d::UnitX();
};

/// Centrelines of about 0.4 m in a pose of their own: straight; a torus piece of bend radius 8 R over 150°; an S of two
/// opposite bends of 60°. Points `step_m` apart.
enum class Course { straight, torus, s_bend };
std::vector<AxisPoint> course_points(Course course, double radius_m, double step_m, const Eigen::Isometry3d& pose);

/// A random turn, and a shift that puts the origin 0.8 m or so in front of the camera.
Eigen::Isometry3d random_pose(std::mt19937_64& random);

/// Surfels of a tube's surface, `spacing_m` apart both ways, their band of radii [0, R + ε].
struct SurfelScene {
  double spacing_m = 0.003;
  double normal_noise_rad = 0.0;  ///< about each of two axes
  bool camera_side_only = false;  ///< only what faces the camera in the origin
  double epsilon_m = 0.001;       ///< the paper's ε
};
std::vector<Surfel> tube_surface(const std::vector<AxisPoint>& axis, double radius_m, const SurfelScene& scene,
                                 std::mt19937_64& random);

/// A height map whose every cell holds what its ray meets first of the cylinder of radius R around the line through
/// `point_m` along `axis` (unit), from −half_m to +half_m of the point; nothing elsewhere. Readings are exact to float.
HeightMap cylinder_map(const Intrinsics& intrinsics, const Eigen::Vector3d& point_m, const Eigen::Vector3d& axis,
                       double half_m, double radius_m);

/// A straight model through the same cylinder.
TubeModel straight_model(const Eigen::Vector3d& point_m, const Eigen::Vector3d& axis, double half_m, double radius_m);

}  // namespace tubetrack
