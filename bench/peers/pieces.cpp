#include "pieces.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>

namespace tubetrack::bench {

namespace {

using Eigen::Vector3d;

struct Plane {
  Vector3d normal = Vector3d::Zero();
  double offset_m = 0.0;
};

/// Three σ of the depth noise, at least 6 mm.
bool on(const Plane& plane, const Vector3d& point) {
  const double reach_m = std::max(0.006, 0.008 * point.z() * point.z());
  return std::abs(plane.normal.dot(point) - plane.offset_m) < reach_m;
}

std::vector<Vector3d> all_points(const DepthFrame& frame, const Intrinsics& camera) {
  std::vector<Vector3d> points;
  const std::vector<Eigen::Vector2f>& rays = rays_of(camera);
  for (int v = 0; v < frame.height; ++v) {
    for (int u = 0; u < frame.width; ++u) {
      if (frame.row(v)[u] == 0) continue;
      const auto& ray =
          rays[static_cast<std::size_t>(v) * static_cast<std::size_t>(frame.width) + static_cast<std::size_t>(u)];
      points.emplace_back(frame.row(v)[u] * frame.metres_per_unit * ray.cast<double>().homogeneous());
    }
  }
  return points;
}

/// Least squares through the points on it.
Plane refined(const Plane& plane, const std::vector<Vector3d>& sample) {
  Vector3d mean = Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  double count = 0.0;
  for (const Vector3d& point : sample) {
    if (!on(plane, point)) continue;
    mean += point;
    second += point * point.transpose();
    count += 1.0;
  }
  if (count < 3.0) return plane;
  mean /= count;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(second / count - mean * mean.transpose());
  const Vector3d normal = solver.eigenvectors().col(0);
  return {normal, normal.dot(mean)};
}

/// RANSAC over 300 triples of a sample of 4000 points; the share of points on it.
double largest_plane(const std::vector<Vector3d>& points, std::mt19937& random, Plane& best) {
  if (points.size() < 1000) return 0.0;
  std::vector<Vector3d> sample(4000);
  std::ranges::generate(sample, [&] { return points[random() % points.size()]; });
  const auto count_on = [&](const Plane& plane) {
    return std::ranges::count_if(sample, [&](const Vector3d& point) { return on(plane, point); });
  };
  std::ptrdiff_t most = 0;
  for (int i = 0; i < 300; ++i) {
    const Vector3d &a = sample[random() % sample.size()], &b = sample[random() % sample.size()];
    const Vector3d normal = (b - a).cross(sample[random() % sample.size()] - a);
    if (normal.norm() < 1e-6) continue;
    const Plane plane{normal.normalized(), normal.normalized().dot(a)};
    const auto here = count_on(plane);
    if (here <= most) continue;
    most = here;
    best = plane;
  }
  for (int i = 0; i < 3; ++i) best = refined(best, sample);
  return static_cast<double>(count_on(best)) / static_cast<double>(sample.size());
}

}  // namespace

const std::vector<Eigen::Vector2f>& rays_of(const Intrinsics& camera) {
  const auto numbers = [](const Intrinsics& c) {
    return std::make_tuple(c.width, c.height, c.fx_px, c.fy_px, c.cx_px, c.cy_px, c.distortion);
  };
  thread_local Intrinsics last;
  thread_local std::vector<Eigen::Vector2f> rays;
  if (rays.empty() || numbers(last) != numbers(camera)) {
    rays = ray_table(camera);
    last = camera;
  }
  return rays;
}

std::vector<Vector3d> points_off_planes(const DepthFrame& frame, const Intrinsics& camera) {
  std::vector<Vector3d> points = all_points(frame, camera);
  const auto whole = static_cast<double>(points.size());
  std::mt19937 random(1);
  for (int i = 0; i < 4; ++i) {
    Plane plane;
    const double share = largest_plane(points, random, plane);
    if (share * static_cast<double>(points.size()) < 0.15 * whole) break;
    std::erase_if(points, [&](const Vector3d& point) { return on(plane, point); });
  }
  return points;
}

std::vector<Tube> straight_pieces(const Cylinder& cylinder, const std::vector<Vector3d>& points, double focal_px) {
  std::vector<double> along_m(points.size());
  std::ranges::transform(points, along_m.begin(),
                         [&](const Vector3d& point) { return cylinder.direction.dot(point - cylinder.point_m); });
  std::ranges::sort(along_m);
  std::vector<Tube> pieces;
  for (std::size_t from = 0; from < along_m.size();) {
    std::size_t to = from + 1;
    while (to < along_m.size() && along_m[to] - along_m[to - 1] < cylinder.radius_m) ++to;
    const Vector3d a = cylinder.point_m + along_m[from] * cylinder.direction;
    const Vector3d b = cylinder.point_m + along_m[to - 1] * cylinder.direction;
    const double length_m = (b - a).norm();
    const double pixels = 2.0 * cylinder.radius_m * length_m * std::pow(focal_px / (0.5 * (a + b)).z(), 2);
    if (length_m >= std::max(1.5 * cylinder.radius_m, 0.020) && static_cast<double>(to - from) > 0.3 * pixels) {
      Tube tube;
      tube.radius_m = cylinder.radius_m;
      tube.length_m = length_m;
      tube.confidence = 1.0;
      tube.centerline_m = {a, b};
      pieces.push_back(tube);
    }
    from = to;
  }
  return pieces;
}

}  // namespace tubetrack::bench
