#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace tubetrack {

struct Neighbour {
  std::uint32_t index = 0;
  double squared_distance = 0.0;
};

/// A k-d tree over points that stay where they are while it lives.
class PointTree {
 public:
  explicit PointTree(std::span<const Eigen::Vector3d> points);
  ~PointTree();
  PointTree(const PointTree&) = delete;
  PointTree& operator=(const PointTree&) = delete;

  /// All points in the tree's own order: near points come soon after each other. Searching in this order spares the
  /// cache: with half a million points in no order, half of the time.
  std::span<const std::uint32_t> order() const;

  /// The `count` nearest points, nearest first, the point itself included where it is one of them; fewer when there are
  /// no more.
  void nearest(const Eigen::Vector3d& point, std::size_t count, std::vector<Neighbour>& result) const;
  /// The points nearer than `radius`, in no particular order, but always in the same.
  void within(const Eigen::Vector3d& point, double radius, std::vector<Neighbour>& result) const;

 private:
  struct PointSet;
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace tubetrack
