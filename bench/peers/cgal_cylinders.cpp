#include <CGAL/Shape_detection/Efficient_RANSAC.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/jet_estimate_normals.h>
#include <CGAL/property_map.h>

#include "peers.hpp"
#include "pieces.hpp"

namespace tubetrack::bench {

namespace {

constexpr unsigned kNeighbours = 50;
constexpr std::size_t kLeastPoints = 300;

using Kernel = CGAL::Simple_cartesian<double>;
using PointAndNormal = std::pair<Kernel::Point_3, Kernel::Vector_3>;
using PointMap = CGAL::First_of_pair_property_map<PointAndNormal>;
using NormalMap = CGAL::Second_of_pair_property_map<PointAndNormal>;
using Traits = CGAL::Shape_detection::Efficient_RANSAC_traits<Kernel, std::vector<PointAndNormal>, PointMap, NormalMap>;
using Ransac = CGAL::Shape_detection::Efficient_RANSAC<Traits>;
using CylinderShape = CGAL::Shape_detection::Cylinder<Traits>;

/// The best of a grid on the tuning seeds: coverage first, then RMS.
Ransac::Parameters parameters() {
  Ransac::Parameters chosen;
  chosen.probability = 0.001;
  chosen.min_points = kLeastPoints;
  chosen.epsilon = 0.002;
  chosen.cluster_epsilon = 0.020;
  chosen.normal_threshold = 0.95;
  return chosen;
}

template <class T>
Eigen::Vector3d eigen(const T& value) {
  return {value.x(), value.y(), value.z()};
}

}  // namespace

std::vector<Tube> cgal_cylinders(const DepthFrame& frame, const Intrinsics& camera) {
  std::vector<PointAndNormal> points;
  for (const Eigen::Vector3d& p : points_off_planes(frame, camera)) {
    points.emplace_back(Kernel::Point_3(p.x(), p.y(), p.z()), Kernel::Vector_3(0.0, 0.0, 0.0));
  }
  std::vector<Tube> tubes;
  if (points.size() < kLeastPoints) return tubes;
  CGAL::jet_estimate_normals<CGAL::Sequential_tag>(points, kNeighbours,
                                                   CGAL::parameters::point_map(PointMap()).normal_map(NormalMap()));
  CGAL::get_default_random() = CGAL::Random(1);
  Ransac ransac;
  ransac.set_input(points);
  ransac.add_shape_factory<CylinderShape>();
  ransac.detect(parameters());
  for (const auto& shape : ransac.shapes()) {
    const auto* found = dynamic_cast<const CylinderShape*>(shape.get());
    if (found == nullptr || found->radius() < kLeastRadius_m || found->radius() > kLargestRadius_m) continue;
    const Cylinder cylinder{eigen(found->axis().point()), eigen(found->axis().to_vector()).normalized(),
                            found->radius()};
    std::vector<Eigen::Vector3d> own;
    for (const std::size_t index : shape->indices_of_assigned_points()) own.push_back(eigen(points[index].first));
    for (const Tube& piece : straight_pieces(cylinder, own, camera.fx_px)) tubes.push_back(piece);
  }
  return tubes;
}

}  // namespace tubetrack::bench
