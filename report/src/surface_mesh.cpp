#include "tubetrack/report/surface_mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace tubetrack {

namespace {

using Color = std::array<std::uint8_t, 3>;
constexpr Color kStraight{120, 180, 235}, kArc{30, 70, 160}, kFree{235, 150, 60};

/// The node `i` of a ring or a line; beyond a line's ends it goes straight on.
Eigen::Vector3d node_at(const Tube& tube, std::ptrdiff_t i) {
  const auto& nodes = tube.centerline_m;
  const auto count = static_cast<std::ptrdiff_t>(nodes.size());
  if (tube.closed) {
    const std::ptrdiff_t period = count - 1;
    return nodes[static_cast<std::size_t>((i % period + period) % period)];
  }
  if (i < 0) return 2.0 * nodes.front() - nodes[1];
  if (i >= count) return 2.0 * nodes.back() - nodes[nodes.size() - 2];
  return nodes[static_cast<std::size_t>(i)];
}

Color color_at(const Tube& tube, double along_m) {
  for (const Segment& segment : tube.segments) {
    if (along_m > segment.to_m) continue;
    return segment.type == Segment::Type::arc ? kArc : segment.type == Segment::Type::free ? kFree : kStraight;
  }
  if (tube.segments.empty()) return kFree;
  return tube.segments.back().type == Segment::Type::straight ? kStraight : kArc;
}

void add_ring(SurfaceMesh& mesh, const Eigen::Vector3d& center_m, const Eigen::Vector3d& e1, const Eigen::Vector3d& e2,
              double radius_m, int sides, const Color& color) {
  for (int k = 0; k < sides; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / sides;
    mesh.points_m.emplace_back(center_m + radius_m * (std::cos(angle) * e1 + std::sin(angle) * e2));
    mesh.colors.push_back(color);
  }
}

void add_band(SurfaceMesh& mesh, std::uint32_t first, std::uint32_t second, int sides, int shift) {
  const auto n = static_cast<std::uint32_t>(sides);
  for (std::uint32_t k = 0; k < n; ++k) {
    const std::uint32_t next = (k + 1) % n, turn = static_cast<std::uint32_t>((shift % sides + sides) % sides);
    const std::uint32_t a = first + k, b = first + next, c = second + (k + turn) % n, d = second + (next + turn) % n;
    mesh.faces.push_back({a, b, d});
    mesh.faces.push_back({a, d, c});
  }
}

void add_cap(SurfaceMesh& mesh, const Eigen::Vector3d& center_m, std::uint32_t ring, int sides, bool front) {
  const auto center = static_cast<std::uint32_t>(mesh.points_m.size());
  mesh.points_m.push_back(center_m);
  mesh.colors.push_back(mesh.colors[ring]);
  const auto n = static_cast<std::uint32_t>(sides);
  for (std::uint32_t k = 0; k < n; ++k) {
    const std::uint32_t a = ring + k, b = ring + (k + 1) % n;
    mesh.faces.push_back(front ? std::array{center, b, a} : std::array{center, a, b});
  }
}

}  // namespace

std::vector<Eigen::Vector3d> smooth_centerline(const Tube& tube, int pieces) {
  std::vector<Eigen::Vector3d> line;
  const auto count = static_cast<std::ptrdiff_t>(tube.centerline_m.size());
  if (count < 2) return tube.centerline_m;
  for (std::ptrdiff_t i = 0; i + 1 < count; ++i) {
    const Eigen::Vector3d p0 = node_at(tube, i - 1), p1 = node_at(tube, i), p2 = node_at(tube, i + 1),
                          p3 = node_at(tube, i + 2);
    for (int k = 0; k < pieces; ++k) {
      const double s = static_cast<double>(k) / pieces;
      line.emplace_back(0.5 * (2.0 * p1 + s * (p2 - p0) + s * s * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3) +
                               s * s * s * (3.0 * p1 - p0 - 3.0 * p2 + p3)));
    }
  }
  line.push_back(tube.centerline_m.back());
  return line;
}

SurfaceMesh surface_of(const Tube& tube, int sides) {
  constexpr int kPieces = 4;
  SurfaceMesh mesh;
  std::vector<Eigen::Vector3d> line = smooth_centerline(tube, kPieces);
  if (line.size() < 2 || sides < 3) return mesh;
  if (tube.closed) line.pop_back();
  const std::size_t count = line.size();
  Eigen::Vector3d e1 = Eigen::Vector3d::Zero();
  Eigen::Vector3d first_e1 = e1, e2 = e1;
  double along_m = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d& before = line[i > 0 ? i - 1 : tube.closed ? count - 1 : 0];
    const Eigen::Vector3d& after = line[i + 1 < count ? i + 1 : tube.closed ? 0 : i];
    const Eigen::Vector3d along = (after - before).normalized();
    e1 -= e1.dot(along) * along;
    e1 = e1.norm() > 1e-6 ? Eigen::Vector3d(e1.normalized()) : Eigen::Vector3d(along.unitOrthogonal());
    e2 = along.cross(e1);
    if (i == 0) first_e1 = e1;
    if (i > 0) along_m += (line[i] - line[i - 1]).norm();
    const std::size_t node = std::min(i / kPieces, tube.centerline_m.size() - 1);
    const double radius_m = tube.node_radius_m.empty() ? tube.radius_m : tube.node_radius_m[node];
    add_ring(mesh, line[i], e1, e2, radius_m, sides, color_at(tube, along_m));
  }
  const auto ring_at = [&](std::size_t i) { return static_cast<std::uint32_t>(i) * static_cast<std::uint32_t>(sides); };
  for (std::size_t i = 0; i + 1 < count; ++i) add_band(mesh, ring_at(i), ring_at(i + 1), sides, 0);
  if (tube.closed) {
    // Carried once around, the axes come back turned: the last band joins the points that are next to each other.
    const double turn = std::atan2(first_e1.dot(e2), first_e1.dot(e1));
    const int shift = -static_cast<int>(std::lround(turn * sides / (2.0 * std::numbers::pi)));
    add_band(mesh, ring_at(count - 1), 0, sides, shift);
  } else {
    add_cap(mesh, line.front(), 0, sides, true);
    add_cap(mesh, line.back(), ring_at(count - 1), sides, false);
  }
  return mesh;
}

void append(SurfaceMesh& mesh, const SurfaceMesh& other) {
  const auto first = static_cast<std::uint32_t>(mesh.points_m.size());
  const bool colored = !mesh.colors.empty() || !other.colors.empty();
  const bool measured = !mesh.distance_m.empty() || !other.distance_m.empty();
  mesh.colors.resize(colored ? mesh.points_m.size() : 0);
  mesh.distance_m.resize(measured ? mesh.points_m.size() : 0);
  mesh.points_m.insert(mesh.points_m.end(), other.points_m.begin(), other.points_m.end());
  mesh.colors.insert(mesh.colors.end(), other.colors.begin(), other.colors.end());
  mesh.distance_m.insert(mesh.distance_m.end(), other.distance_m.begin(), other.distance_m.end());
  mesh.colors.resize(colored ? mesh.points_m.size() : 0);
  mesh.distance_m.resize(measured ? mesh.points_m.size() : 0);
  for (std::array<std::uint32_t, 3> face : other.faces) {
    for (std::uint32_t& corner : face) corner += first;
    mesh.faces.push_back(face);
  }
}

}  // namespace tubetrack
