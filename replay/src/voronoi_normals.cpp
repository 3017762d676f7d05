#include "voronoi_normals.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include "point_tree.hpp"

namespace tubetrack {

namespace {

/// xx, xy, xz, yy, yz, zz.
using Moments = Eigen::Matrix<double, 6, 1>;

/// One layer of the lattice: for each place the nearest point so far.
class Layer {
 public:
  Layer(int width, int height)
      : width_(width), height_(height), nearest_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  /// The places of the layer `z` that are nearer than `offset` to the point; all in steps of the lattice. Of two points
  /// as near the first stays.
  void reach(std::uint32_t index, const Eigen::Vector3d& point, double z, double offset) {
    const double dz2 = (z - point.z()) * (z - point.z()), left = offset * offset - dz2;
    if (left < 0.0) return;
    const double half = std::sqrt(left);
    const int v_last = std::min(height_ - 1, static_cast<int>(std::floor(point.y() + half)));
    for (int v = std::max(0, static_cast<int>(std::ceil(point.y() - half))); v <= v_last; ++v) {
      const double dy2 = (v - point.y()) * (v - point.y());
      const double across = std::sqrt(std::max(0.0, left - dy2));
      const int u_last = std::min(width_ - 1, static_cast<int>(std::floor(point.x() + across)));
      for (int u = std::max(0, static_cast<int>(std::ceil(point.x() - across))); u <= u_last; ++u) {
        const double d2 = (u - point.x()) * (u - point.x()) + dy2 + dz2;
        const std::size_t at =
            static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(u);
        Nearest& nearest = nearest_[at];
        if (!(d2 < nearest.squared_distance)) continue;
        if (nearest.squared_distance == kNone) touched_.push_back(at);
        nearest = {d2, index};
      }
    }
  }

  /// Hands each place to its point, and empties the layer.
  void hand_out(std::span<const Eigen::Vector3d> points, double z, std::vector<Moments>& moments) {
    for (const std::size_t at : touched_) {
      const std::uint32_t index = nearest_[at].index;
      const std::size_t row = at / static_cast<std::size_t>(width_);
      const std::size_t col = at % static_cast<std::size_t>(width_);
      const Eigen::Vector3d off =
          Eigen::Vector3d(static_cast<double>(col), static_cast<double>(row), z) - points[index];
      moments[index] += (Moments() << off.x() * off.x(), off.x() * off.y(), off.x() * off.z(), off.y() * off.y(),
                         off.y() * off.z(), off.z() * off.z())
                            .finished();
      nearest_[at] = {};
    }
    touched_.clear();
  }

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  struct Nearest {
    double squared_distance = kNone;
    std::uint32_t index = 0;
  };
  int width_, height_;
  std::vector<Nearest> nearest_;
  std::vector<std::size_t> touched_;
};

/// Layer by layer, so that memory grows with a section of the scan and not with its volume. Points in steps.
std::vector<Moments> voronoi_moments(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& size,
                                     double offset) {
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return points[i].z(); });
  std::vector<Moments> moments(points.size(), Moments::Zero());
  Layer layer(static_cast<int>(std::ceil(size.x())) + 1, static_cast<int>(std::ceil(size.y())) + 1);
  std::size_t first = 0, last = 0;
  for (double z = 0.0; first < order.size(); z += 1.0) {
    while (first < order.size() && points[order[first]].z() < z - offset) ++first;
    // Layers that no point reaches are not visited one by one: heights may lie far apart.
    if (first < order.size()) z = std::max(z, std::ceil(points[order[first]].z() - offset));
    while (last < order.size() && points[order[last]].z() <= z + offset) ++last;
    for (std::size_t i = first; i < last; ++i) layer.reach(order[i], points[order[i]], z, offset);
    layer.hand_out(points, z, moments);
  }
  return moments;
}

}  // namespace

std::vector<Eigen::Vector3f> voronoi_normals(std::span<const Eigen::Vector3d> points_m,
                                             std::span<const Eigen::Vector3d> outward, const VoronoiScale& scale) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point_m : points_m) box.extend(point_m);
  const double offset = scale.offset_m / scale.step_m, margin = std::ceil(offset);
  // Beside the grid, or many places would be as near to one point as to the next, and all of them be the first one's.
  const Eigen::Vector3d beside(0.13, 0.27, 0.41);
  std::vector<Eigen::Vector3d> points;
  points.reserve(points_m.size());
  for (const Eigen::Vector3d& point_m : points_m)
    points.emplace_back((point_m - box.min()) / scale.step_m + Eigen::Vector3d::Constant(margin) + beside);
  if (points.empty()) return {};
  const Eigen::Vector3d size = box.sizes() / scale.step_m + Eigen::Vector3d::Constant(2.0 * margin) + beside;
  const std::vector<Moments> moments = voronoi_moments(points, size, offset);
  const PointTree tree(points);
  const double radius = scale.radius_m / scale.step_m;
  std::vector<Eigen::Vector3f> normals(points.size());
  std::vector<Neighbour> near;
  for (const std::uint32_t i : tree.order()) {
    tree.within(points[i], radius, near);
    Moments sum = Moments::Zero();
    Eigen::Vector3d out = Eigen::Vector3d::Zero();
    for (const Neighbour& one : near) {
      const double weight = std::max(0.0, 1.0 - std::sqrt(one.squared_distance) / radius);
      sum += weight * moments[one.index];
      out += weight * outward[one.index];
    }
    if (!(out.norm() > 1e-6 * outward[i].norm())) out = outward[i];
    Eigen::Matrix3d measure;
    measure << sum[0], sum[1], sum[2], sum[1], sum[3], sum[4], sum[2], sum[4], sum[5];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(measure);
    Eigen::Vector3d normal = solver.eigenvectors().col(2);
    if (!(solver.eigenvalues()[2] > 0.0)) normal = out.normalized();
    normals[i] = (normal.dot(out) < 0.0 ? Eigen::Vector3d(-normal) : normal).cast<float>();
  }
  return normals;
}

}  // namespace tubetrack
