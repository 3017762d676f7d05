#include "ray_cast.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tubetrack {

namespace {

constexpr double kMiss = std::numeric_limits<double>::infinity();
// Parts of a tube meet in a circle; this little overlap keeps rays from slipping through.
constexpr double kOverlap = 1e-10;

/// Real roots of a t² + 2 b t + c, ascending, without cancellation. Returns how many.
int quadratic_roots(double a, double half_b, double c, std::array<double, 2>& roots) {
  if (std::abs(a) < 1e-300) {
    if (half_b == 0.0) return 0;
    roots[0] = -c / (2.0 * half_b);
    return 1;
  }
  const double discriminant = half_b * half_b - a * c;
  if (discriminant < 0.0) return 0;
  const double q = -(half_b + std::copysign(std::sqrt(discriminant), half_b));
  roots = {q / a, q == 0.0 ? 0.0 : c / q};
  if (roots[0] > roots[1]) std::swap(roots[0], roots[1]);
  return 2;
}

/// t⁴ + p t² + q t + r and its derivative.
struct DepressedQuartic {
  double p, q, r;
  double operator()(double t) const { return ((t * t + p) * t + q) * t + r; }
  double slope(double t) const { return (4.0 * t * t + 2.0 * p) * t + q; }
  double curvature(double t) const { return 12.0 * t * t + 2.0 * p; }
};

/// The root of a function that is monotone on [low, high] and changes sign there: Newton, bisecting where it leaves.
template <class Function, class Slope>
double root_between(const Function& f, const Slope& slope, double low, double high) {
  const bool rising = f(low) < 0.0;
  double t = 0.5 * (low + high);
  for (int i = 0; i < 100; ++i) {
    const double value = f(t);
    if (value == 0.0) return t;
    ((value < 0.0) == rising ? low : high) = t;
    double next = t - value / slope(t);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - t) <= 1e-15 * std::max(1.0, std::abs(t))) return next;
    t = next;
  }
  return t;
}

/// Roots of f between neighbouring stops, ascending; f is monotone between two stops. Returns how many.
template <class Function, class Slope>
int roots_between(const Function& f, const Slope& slope, const double* stops, int stop_count, double* roots) {
  int count = 0;
  for (int i = 0; i + 1 < stop_count; ++i) {
    if ((f(stops[i]) < 0.0) != (f(stops[i + 1]) < 0.0)) {
      roots[count++] = root_between(f, slope, stops[i], stops[i + 1]);
    }
  }
  return count;
}

/// Roots in [−limit, limit], ascending: the curvature's roots bracket the slope's, which bracket the quartic's.
int quartic_roots(const DepressedQuartic& f, double limit, std::array<double, 4>& roots) {
  std::array<double, 4> inflections{-limit};
  int inflection_count = 1;
  if (f.p < 0.0) {
    const double t = std::sqrt(-f.p / 6.0);
    if (t < limit) {
      inflections[1] = -t;
      inflections[2] = t;
      inflection_count = 3;
    }
  }
  inflections[inflection_count++] = limit;
  const auto slope = [&](double t) { return f.slope(t); };
  const auto curvature = [&](double t) { return f.curvature(t); };
  std::array<double, 5> turns{-limit};
  int turn_count = 1 + roots_between(slope, curvature, inflections.data(), inflection_count, turns.data() + 1);
  turns[turn_count++] = limit;
  return roots_between(f, slope, turns.data(), turn_count, roots.data());
}

}  // namespace

double first_hit(const FrustumWall& wall, const Ray& ray) {
  const Eigen::Vector3d to = ray.origin - wall.from_m;
  const Eigen::Vector3d& d = ray.direction;
  const double along = to.dot(wall.axis);
  const double along_rate = d.dot(wall.axis);
  const double taper = (wall.to_radius_m - wall.from_radius_m) / wall.length_m;
  const double radius = wall.from_radius_m + taper * along;  // of the cone's section beside the ray's origin
  const double radius_rate = taper * along_rate;
  std::array<double, 2> roots{};
  const int count = quadratic_roots(d.dot(d) - along_rate * along_rate - radius_rate * radius_rate,
                                    to.dot(d) - along * along_rate - radius * radius_rate,
                                    to.dot(to) - along * along - radius * radius, roots);
  for (int i = 0; i < count; ++i) {
    const double s = along + roots[i] * along_rate;
    if (roots[i] > 0.0 && s >= -kOverlap && s <= wall.length_m + kOverlap) return roots[i];
  }
  return kMiss;
}

double first_hit(const TorusArc& arc, const Ray& ray) {
  // In units of the torus's outer radius, from the point of the ray nearest to its centre: roots lie in [−1, 1].
  const double scale = arc.bend_radius_m + arc.radius_m;
  const double speed = ray.direction.norm();
  const Eigen::Vector3d d = ray.direction / speed;
  const Eigen::Vector3d to = (ray.origin - arc.center_m) / scale;
  const double nearest = -to.dot(d);
  const Eigen::Vector3d p = to + nearest * d;
  const double p2 = p.dot(p);
  if (p2 >= 1.0) return kMiss;
  const Eigen::Vector3d axis = arc.to_start.cross(arc.tangent);
  const double b = arc.bend_radius_m / scale;
  const double r = arc.radius_m / scale;
  const double z = p.dot(axis);
  const double dz = d.dot(axis);
  const double g = p2 + b * b - r * r;
  const DepressedQuartic f{2.0 * g - 4.0 * b * b * (1.0 - dz * dz), 8.0 * b * b * z * dz,
                           g * g - 4.0 * b * b * (p2 - z * z)};
  std::array<double, 4> roots{};
  const int count = quartic_roots(f, std::sqrt(1.0 - p2) + 1e-9, roots);
  for (int i = 0; i < count; ++i) {
    const double t = (nearest + roots[i]) * scale / speed;
    if (t <= 0.0) continue;
    const Eigen::Vector3d hit = p + roots[i] * d;
    double angle = std::atan2(hit.dot(arc.tangent), hit.dot(arc.to_start));
    if (angle < -kOverlap) angle += 2.0 * std::numbers::pi;
    if (angle <= arc.angle_rad + kOverlap) return t;
  }
  return kMiss;
}

double first_hit(const InfinitePlane& plane, const Ray& ray) {
  const double t = (plane.point_m - ray.origin).dot(plane.normal) / ray.direction.dot(plane.normal);
  return std::isfinite(t) && t > 0.0 ? t : kMiss;
}

double first_hit(const Disc& disc, const Ray& ray) {
  const double t = first_hit(InfinitePlane{disc.center_m, disc.normal}, ray);
  if (t == kMiss) return kMiss;
  const Eigen::Vector3d point = ray.origin + t * ray.direction;
  return (point - disc.center_m).squaredNorm() <= disc.radius_m * disc.radius_m ? t : kMiss;
}

double first_hit(const OrientedBox& box, const Ray& ray) {
  const Eigen::Vector3d o = box.box_from_camera * ray.origin;
  const Eigen::Vector3d d = box.box_from_camera.linear() * ray.direction;
  double enter = -kMiss;
  double leave = kMiss;
  for (int i = 0; i < 3; ++i) {
    if (d[i] == 0.0) {
      if (std::abs(o[i]) > box.half_size_m[i]) return kMiss;
      continue;
    }
    const double t0 = (-box.half_size_m[i] - o[i]) / d[i];
    const double t1 = (box.half_size_m[i] - o[i]) / d[i];
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  }
  if (enter > leave || leave <= 0.0) return kMiss;
  return enter > 0.0 ? enter : leave;
}

double first_hit(const SphereWall& sphere, const Ray& ray) {
  const Eigen::Vector3d to = ray.origin - sphere.center_m;
  std::array<double, 2> roots{};
  const int count = quadratic_roots(ray.direction.squaredNorm(), to.dot(ray.direction),
                                    to.squaredNorm() - sphere.radius_m * sphere.radius_m, roots);
  for (int i = 0; i < count; ++i) {
    if (roots[i] <= 0.0) continue;
    if (!sphere.half || (to + roots[i] * ray.direction).dot(sphere.opening) <= 0.0) return roots[i];
  }
  return kMiss;
}

namespace {

struct NormalAt {
  const Eigen::Vector3d& point;

  Eigen::Vector3d operator()(const FrustumWall& wall) const {
    const Eigen::Vector3d to = point - wall.from_m;
    const Eigen::Vector3d outward = (to - to.dot(wall.axis) * wall.axis).normalized();
    const double taper = (wall.to_radius_m - wall.from_radius_m) / wall.length_m;
    return (outward - taper * wall.axis).normalized();
  }
  Eigen::Vector3d operator()(const TorusArc& arc) const {
    const Eigen::Vector3d to = point - arc.center_m;
    const Eigen::Vector3d axis = arc.to_start.cross(arc.tangent);
    const Eigen::Vector3d in_plane = (to - to.dot(axis) * axis).normalized();
    return (to - arc.bend_radius_m * in_plane).normalized();
  }
  Eigen::Vector3d operator()(const Disc& disc) const { return disc.normal; }
  Eigen::Vector3d operator()(const InfinitePlane& plane) const { return plane.normal; }
  Eigen::Vector3d operator()(const OrientedBox& box) const {
    Eigen::Index face = 0;
    (box.box_from_camera * point).cwiseQuotient(box.half_size_m).cwiseAbs().maxCoeff(&face);
    return box.box_from_camera.linear().row(face);
  }
  Eigen::Vector3d operator()(const SphereWall& sphere) const { return (point - sphere.center_m).normalized(); }
};

struct BoundingBalls {
  std::vector<Ball> operator()(const FrustumWall& wall) const {
    return {{wall.from_m, wall.from_radius_m}, {wall.from_m + wall.length_m * wall.axis, wall.to_radius_m}};
  }
  std::vector<Ball> operator()(const TorusArc& arc) const {
    // Between two stations the arc bulges out of their hull by the sagitta.
    const int steps = 1 + static_cast<int>(arc.angle_rad / 0.2);
    const double step = arc.angle_rad / steps;
    const double radius = arc.radius_m + arc.bend_radius_m * (1.0 - std::cos(step / 2.0));
    std::vector<Ball> balls;
    for (int i = 0; i <= steps; ++i) {
      const Eigen::Vector3d out = std::cos(i * step) * arc.to_start + std::sin(i * step) * arc.tangent;
      balls.push_back({arc.center_m + arc.bend_radius_m * out, radius});
    }
    return balls;
  }
  std::vector<Ball> operator()(const Disc& disc) const { return {{disc.center_m, disc.radius_m}}; }
  std::vector<Ball> operator()(const InfinitePlane&) const { return {}; }
  std::vector<Ball> operator()(const OrientedBox& box) const {
    const Eigen::Isometry3d camera_from_box = box.box_from_camera.inverse();
    std::vector<Ball> balls;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d sign((i & 1) ? 1.0 : -1.0, (i & 2) ? 1.0 : -1.0, (i & 4) ? 1.0 : -1.0);
      balls.push_back({camera_from_box * box.half_size_m.cwiseProduct(sign), 0.0});
    }
    return balls;
  }
  std::vector<Ball> operator()(const SphereWall& sphere) const { return {{sphere.center_m, sphere.radius_m}}; }
};

}  // namespace

Eigen::Vector3d normal_at(const PrimitiveShape& shape, const Eigen::Vector3d& point_m) {
  return std::visit(NormalAt{point_m}, shape);
}

std::vector<Ball> bounding_balls(const PrimitiveShape& shape) {
  return std::visit(BoundingBalls{}, shape);
}

}  // namespace tubetrack
