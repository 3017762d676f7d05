#include "tracker/tube_scene.hpp"

#include <cmath>
#include <numbers>

namespace tubetrack {

namespace {

using Eigen::Vector3d;

/// Follows the course in the x-y plane from its curvature.
std::vector<AxisPoint> integrate(double length_m, double step_m, auto curvature_at) {
  std::vector<AxisPoint> points;
  const int steps = static_cast<int>(std::ceil(length_m / step_m));
  const double step = length_m / steps;
  double angle = 0.0;
  Vector3d at = Vector3d::Zero();
  for (int i = 0; i <= steps; ++i) {
    points.push_back({at, {std::cos(angle), std::sin(angle), 0.0}});
    const double turn = step * curvature_at((i + 0.5) * step);
    at += step * Vector3d(std::cos(angle + 0.5 * turn), std::sin(angle + 0.5 * turn), 0.0);
    angle += turn;
  }
  return points;
}

}  // namespace

std::vector<AxisPoint> course_points(Course course, double radius_m, double step_m, const Eigen::Isometry3d& pose) {
  const double bend_m = 8.0 * radius_m;
  constexpr double kPi = std::numbers::pi;
  double length_m = 0.4;
  std::vector<AxisPoint> points;
  if (course == Course::straight) points = integrate(length_m, step_m, [](double) { return 0.0; });
  if (course == Course::torus) {
    length_m = bend_m * 150.0 / 180.0 * kPi;
    points = integrate(length_m, step_m, [&](double) { return 1.0 / bend_m; });
  }
  if (course == Course::s_bend) {
    const double arc_m = bend_m * kPi / 3.0;
    length_m = 2.0 * arc_m + 0.2;
    points = integrate(length_m, step_m, [&](double s) {
      if (s < 0.1 || s > length_m - 0.1) return 0.0;
      return s < 0.1 + arc_m ? 1.0 / bend_m : -1.0 / bend_m;
    });
  }
  const Vector3d middle = points[points.size() / 2].position_m;
  for (AxisPoint& point : points) {
    point.position_m = pose * (point.position_m - middle);
    point.tangent = pose.linear() * point.tangent;
  }
  return points;
}

Eigen::Isometry3d random_pose(std::mt19937_64& random) {
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> shift(-0.1, 0.1);
  Eigen::Quaterniond turn(gauss(random), gauss(random), gauss(random), gauss(random));
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = turn.normalized().toRotationMatrix();
  pose.translation() = Vector3d(shift(random), shift(random), 0.8 + shift(random));
  return pose;
}

std::vector<Surfel> tube_surface(const std::vector<AxisPoint>& axis, double radius_m, const SurfelScene& scene,
                                 std::mt19937_64& random) {
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> any_angle(0.0, 2.0 * std::numbers::pi);
  const int around = static_cast<int>(std::ceil(2.0 * std::numbers::pi * radius_m / scene.spacing_m));
  std::vector<Surfel> surfels;
  for (const AxisPoint& at : axis) {
    const Vector3d e1 = at.tangent.unitOrthogonal();
    const Vector3d e2 = at.tangent.cross(e1);
    const double phase = any_angle(random);
    for (int i = 0; i < around; ++i) {
      const double angle = phase + 2.0 * std::numbers::pi * i / around;
      const Vector3d outward = std::cos(angle) * e1 + std::sin(angle) * e2;
      const Vector3d position = at.position_m + radius_m * outward;
      if (scene.camera_side_only && outward.dot(position) > 0.0) continue;
      const Vector3d side = outward.cross(at.tangent);
      const Vector3d noisy = -outward + scene.normal_noise_rad * (gauss(random) * side + gauss(random) * at.tangent);
      Surfel surfel;
      surfel.position_m = position.cast<float>();
      surfel.inward_normal = noisy.normalized().cast<float>();
      surfel.radius_min_m = 0.0F;
      surfel.radius_max_m = static_cast<float>(radius_m + scene.epsilon_m);
      surfels.push_back(surfel);
    }
  }
  return surfels;
}

HeightMap cylinder_map(const Intrinsics& intrinsics, const Vector3d& point_m, const Vector3d& axis, double half_m,
                       double radius_m) {
  HeightMap map = make_height_map(intrinsics);
  for (std::size_t at = 0; at < map.rays.size(); ++at) {
    const Vector3d ray(map.rays[at].x(), map.rays[at].y(), 1.0);
    const Vector3d ray_across = ray - ray.dot(axis) * axis;
    const Vector3d point_across = point_m - point_m.dot(axis) * axis;
    const double a = ray_across.squaredNorm();
    const double b = ray_across.dot(point_across);
    const double discriminant = b * b - a * (point_across.squaredNorm() - radius_m * radius_m);
    if (discriminant <= 0.0) continue;
    const double z = (b - std::sqrt(discriminant)) / a;
    if (z <= 0.0 || std::abs((z * ray - point_m).dot(axis)) > half_m) continue;
    map.depth_m[at] = static_cast<float>(z);
    map.inverse_depth_per_m[at] = static_cast<float>(1.0 / z);
    map.variance_per_m2[at] = 1e-10F;
    map.count[at] = 1;
  }
  return map;
}

TubeModel straight_model(const Vector3d& point_m, const Vector3d& axis, double half_m, double radius_m) {
  return {spline_along({point_m - half_m * axis, point_m + half_m * axis}, 1.25 * radius_m), radius_m};
}

}  // namespace tubetrack
