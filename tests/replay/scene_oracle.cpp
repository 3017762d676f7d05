#include "scene_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tubetrack::test {

namespace {

using Eigen::Vector3d;

/// Columns tangent, towards, binormal.
Eigen::Matrix3d start_frame(const SceneTube& tube) {
  Eigen::Matrix3d frame;
  frame.col(0) = tube.direction.normalized();
  frame.col(2) = frame.col(0).cross(tube.bend_direction).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

/// Distance to one part; `past` is how far the point lies before (< 0) or past (> 0) the part's ends, 0 beside it.
double distance_to_part(const TubePart& part, const Vector3d& local, double& past) {
  past = 0.0;
  if (part.type == TubePart::Type::straight) {
    if (local.x() < 0.0) past = local.x();
    if (local.x() > part.length_m) past = local.x() - part.length_m;
    return std::hypot(past, std::hypot(local.y(), local.z()));
  }
  const double b = part.bend_radius_m;
  double angle = std::atan2(local.x(), b - local.y());
  if (angle < 0.0) angle += 2.0 * std::numbers::pi;
  if (angle <= part.angle_rad) {
    return std::hypot(std::hypot(local.x(), b - local.y()) - b, local.z());
  }
  const Vector3d end(b * std::sin(part.angle_rad), b * (1.0 - std::cos(part.angle_rad)), 0.0);
  const Vector3d end_tangent(std::cos(part.angle_rad), std::sin(part.angle_rad), 0.0);
  const double to_start = local.norm();
  const double to_end = (local - end).norm();
  past = to_start < to_end ? std::min(local.x(), 0.0) : std::max((local - end).dot(end_tangent), 0.0);
  if (past == 0.0) past = to_start < to_end ? -1e-300 : 1e-300;
  return std::min(to_start, to_end);
}

struct InsideShape {
  const Vector3d& p;

  bool operator()(const PlaneShape& s) const {
    return (p - s.point_m).dot(s.normal) * (-s.point_m).dot(s.normal) <= 0.0;
  }
  bool operator()(const BoxShape& s) const {
    const Vector3d local = s.rotation.normalized().conjugate() * (p - s.center_m);
    return (local.cwiseAbs() - 0.5 * s.size_m).maxCoeff() <= 0.0;
  }
  bool operator()(const SphereShape& s) const { return (p - s.center_m).norm() <= s.radius_m; }
  bool operator()(const CapsuleShape& s) const {
    const Vector3d axis = s.to_m - s.from_m;
    const double along = std::clamp((p - s.from_m).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
    return (p - s.from_m - along * axis).norm() <= s.radius_m;
  }
  bool operator()(const FrustumShape& s) const {
    const Vector3d axis = s.to_m - s.from_m;
    const double along = (p - s.from_m).dot(axis) / axis.squaredNorm();
    if (along < 0.0 || along > 1.0) return false;
    return (p - s.from_m - along * axis).norm() <= (1.0 - along) * s.from_radius_m + along * s.to_radius_m;
  }
  bool operator()(const BowlShape&) const { return false; }
};

}  // namespace

CenterlineDistance distance_to_centerline(const SceneTube& tube, const Vector3d& point_m) {
  CenterlineDistance best{std::numeric_limits<double>::infinity(), false, 0.0};
  Eigen::Matrix3d frame = start_frame(tube);
  Vector3d at = tube.start_m;
  for (std::size_t i = 0; i < tube.parts.size(); ++i) {
    const TubePart& part = tube.parts[i];
    const bool arc = part.type == TubePart::Type::arc;
    if (arc) frame = frame * Eigen::AngleAxisd(part.rotation_rad, Vector3d::UnitX());
    double past = 0.0;
    const double distance = distance_to_part(part, frame.transpose() * (point_m - at), past);
    if (distance < best.distance_m) {
      const bool free_end = (past < 0.0 && i == 0) || (past > 0.0 && i + 1 == tube.parts.size());
      best = {distance, !free_end, free_end ? std::abs(past) : 0.0};
    }
    if (arc) {
      at += frame * Vector3d(part.bend_radius_m * std::sin(part.angle_rad),
                             part.bend_radius_m * (1.0 - std::cos(part.angle_rad)), 0.0);
      frame = frame * Eigen::AngleAxisd(part.angle_rad, Vector3d::UnitZ());
    } else {
      at += part.length_m * frame.col(0);
    }
  }
  return best;
}

bool inside_scene(const Scene& scene, double time_s, const Vector3d& point_m) {
  for (const SceneTube& tube : scene.tubes) {
    const Vector3d p = motion_at(tube.motion, time_s).inverse() * point_m;
    const CenterlineDistance to = distance_to_centerline(tube, p);
    if (to.distance_m <= tube.radius_m && to.beside) return true;
  }
  for (const Solid& solid : scene.solids) {
    const Vector3d p = motion_at(solid.motion, time_s).inverse() * point_m;
    if (std::visit(InsideShape{p}, solid.shape)) return true;
  }
  return false;
}

}  // namespace tubetrack::test
