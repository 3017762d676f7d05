#include "point_tree.hpp"

#include <nanoflann.hpp>

namespace tubetrack {

/// What nanoflann asks of a set of points.
struct PointTree::PointSet {
  std::span<const Eigen::Vector3d> points;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t index, std::size_t axis) const {
    return points[index][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

struct PointTree::Tree {
  using Distance = nanoflann::L2_Simple_Adaptor<double, PointSet, double, std::uint32_t>;
  using Index = nanoflann::KDTreeSingleIndexAdaptor<Distance, PointSet, 3, std::uint32_t>;

  explicit Tree(std::span<const Eigen::Vector3d> all) : points{all}, index(3, points) {}
  PointSet points;
  Index index;
  mutable std::vector<std::uint32_t> indices;
  mutable std::vector<double> distances;
  mutable std::vector<std::pair<std::uint32_t, double>> found;
};

PointTree::PointTree(std::span<const Eigen::Vector3d> points) : tree_(std::make_unique<Tree>(points)) {}

PointTree::~PointTree() = default;

std::span<const std::uint32_t> PointTree::order() const {
  return tree_->index.vAcc;
}

void PointTree::nearest(const Eigen::Vector3d& point, std::size_t count, std::vector<Neighbour>& result) const {
  tree_->indices.resize(count);
  tree_->distances.resize(count);
  const std::size_t found = tree_->index.knnSearch(point.data(), count, tree_->indices.data(), tree_->distances.data());
  result.clear();
  for (std::size_t i = 0; i < found; ++i) result.push_back({tree_->indices[i], tree_->distances[i]});
}

void PointTree::within(const Eigen::Vector3d& point, double radius, std::vector<Neighbour>& result) const {
  tree_->index.radiusSearch(point.data(), radius * radius, tree_->found, nanoflann::SearchParams(32, 0.0F, false));
  result.clear();
  for (const auto& [index, distance] : tree_->found) result.push_back({index, distance});
}

}  // namespace tubetrack
