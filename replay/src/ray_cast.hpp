#pragma once

#include <Eigen/Geometry>
#include <array>
#include <variant>
#include <vector>

#include "tubetrack/replay/synthetic_scene.hpp"

namespace tubetrack {

// What tubes and solids are made of, in the camera frame (metres). A ray meets a primitive at the smallest t > 0 with
// origin + t * direction on it; closed forms, and for the torus bracketed roots of its quartic.

struct Ray {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// The wall of a cylinder, cone or frustum, without its ends.
struct FrustumWall {
  Eigen::Vector3d from_m, axis;  ///< axis is unit
  double length_m = 0.0, from_radius_m = 0.0, to_radius_m = 0.0;
};
/// The wall of a bent tube: its centreline runs from center + B to_start towards `tangent`, over `angle_rad`.
struct TorusArc {
  Eigen::Vector3d center_m, to_start, tangent;  ///< unit, perpendicular
  double bend_radius_m = 0.0, radius_m = 0.0, angle_rad = 0.0;
};
struct Disc {
  Eigen::Vector3d center_m, normal;
  double radius_m = 0.0;
};
struct InfinitePlane {
  Eigen::Vector3d point_m, normal;
};
struct OrientedBox {
  Eigen::Isometry3d box_from_camera;
  Eigen::Vector3d half_size_m;
};
/// A sphere, or the half of it that lies against `opening`.
struct SphereWall {
  Eigen::Vector3d center_m;
  double radius_m = 0.0;
  bool half = false;
  Eigen::Vector3d opening = Eigen::Vector3d::UnitZ();
};

using PrimitiveShape = std::variant<FrustumWall, TorusArc, Disc, InfinitePlane, OrientedBox, SphereWall>;

/// Smallest t > 0; infinite when the ray misses.
double first_hit(const FrustumWall& wall, const Ray& ray);
double first_hit(const TorusArc& arc, const Ray& ray);
double first_hit(const Disc& disc, const Ray& ray);
double first_hit(const InfinitePlane& plane, const Ray& ray);
double first_hit(const OrientedBox& box, const Ray& ray);
double first_hit(const SphereWall& sphere, const Ray& ray);

/// Unit normal at a point of the primitive; its sign is not defined.
Eigen::Vector3d normal_at(const PrimitiveShape& shape, const Eigen::Vector3d& point_m);

struct Ball {
  Eigen::Vector3d center_m;
  double radius_m = 0.0;
};
/// Balls whose convex hull holds the primitive; none for a plane.
std::vector<Ball> bounding_balls(const PrimitiveShape& shape);

struct Primitive {
  PrimitiveShape shape;
  int object = 0;  ///< as ExactImage::object
};

/// The whole scene at a frame's time, in the camera frame.
std::vector<Primitive> primitives_of(const Scene& scene, int frame);

}  // namespace tubetrack
