#include <pcl/ModelCoefficients.h>
#include <pcl/features/integral_image_normal.h>
#include <pcl/features/normal_3d.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/sac_segmentation.h>

#include <cmath>
#include <limits>

#include "peers.hpp"
#include "pieces.hpp"

namespace tubetrack::bench {

namespace {

constexpr int kNeighbours = 50;
// Of the integral images: window (with PCL's usual 10 px the tube is missed more often), and how much of its depth a
// neighbour may differ by.
constexpr float kSmoothing_px = 15.0F;
constexpr float kEdge = 0.02F;
constexpr double kNormalWeight = 0.01;
// The best of 1.5, 2, 3, 4, 6 and 10 mm on the tuning seeds: less finds fewer tubes, more places them worse.
constexpr double kReach_m = 0.003;
constexpr int kIterations = 2000;
constexpr std::size_t kLeastPoints = 500;
constexpr int kMostCylinders = 12;

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Normals = pcl::PointCloud<pcl::Normal>;

Cloud::Ptr cloud_of(const std::vector<Eigen::Vector3d>& points) {
  auto cloud = pcl::make_shared<Cloud>();
  for (const Eigen::Vector3d& p : points) {
    cloud->emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
  }
  return cloud;
}

Normals::Ptr pca_normals(const Cloud::Ptr& cloud) {
  pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setInputCloud(cloud);
  estimation.setSearchMethod(pcl::make_shared<pcl::search::KdTree<pcl::PointXYZ>>());
  estimation.setKSearch(kNeighbours);
  auto normals = pcl::make_shared<Normals>();
  estimation.compute(*normals);
  return normals;
}

/// The cylinder with the most points, and their places; false where there is none left.
bool next_cylinder(const Cloud::Ptr& cloud, const Normals::Ptr& normals, Cylinder& cylinder,
                   pcl::PointIndices& inliers) {
  pcl::SACSegmentationFromNormals<pcl::PointXYZ, pcl::Normal> segmentation;
  segmentation.setOptimizeCoefficients(true);
  segmentation.setModelType(pcl::SACMODEL_CYLINDER);
  segmentation.setMethodType(pcl::SAC_RANSAC);
  segmentation.setNormalDistanceWeight(kNormalWeight);
  segmentation.setMaxIterations(kIterations);
  segmentation.setDistanceThreshold(kReach_m);
  segmentation.setRadiusLimits(kLeastRadius_m, kLargestRadius_m);
  segmentation.setInputCloud(cloud);
  segmentation.setInputNormals(normals);
  pcl::ModelCoefficients model;
  segmentation.segment(inliers, model);
  if (model.values.size() < 7 || inliers.indices.size() < kLeastPoints) return false;
  cylinder.point_m = Eigen::Vector3f(model.values.data()).cast<double>();
  cylinder.direction = Eigen::Vector3f(model.values.data() + 3).cast<double>().normalized();
  cylinder.radius_m = model.values[6];
  return true;
}

template <class T>
void drop(pcl::PointCloud<T>& cloud, const std::vector<bool>& taken) {
  pcl::PointCloud<T> rest;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!taken[i]) rest.push_back(cloud[i]);
  }
  cloud = rest;
}

/// PCL's integral images want the whole image; of its normals those at `points` are kept, and the points without one
/// are dropped.
Normals::Ptr integral_normals(const DepthFrame& frame, const Intrinsics& camera, Cloud::Ptr& points) {
  const std::vector<Eigen::Vector2f>& rays = rays_of(camera);
  auto image = pcl::make_shared<Cloud>();
  image->width = frame.width;
  image->height = frame.height;
  image->is_dense = false;
  image->resize(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const std::uint16_t reading = frame.row(static_cast<int>(i) / frame.width)[i % frame.width];
    const float z = reading == 0 ? std::numeric_limits<float>::quiet_NaN() : reading * frame.metres_per_unit;
    (*image)[i] = pcl::PointXYZ(rays[i].x() * z, rays[i].y() * z, z);
  }
  pcl::IntegralImageNormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setNormalEstimationMethod(estimation.COVARIANCE_MATRIX);
  estimation.setMaxDepthChangeFactor(kEdge);
  estimation.setNormalSmoothingSize(kSmoothing_px);
  estimation.setInputCloud(image);
  Normals all;
  estimation.compute(all);
  auto kept = pcl::make_shared<Cloud>();
  auto normals = pcl::make_shared<Normals>();
  for (const pcl::PointXYZ& point : *points) {
    const Eigen::Vector2d pixel = project(camera, point.getVector3fMap().cast<double>());
    const auto u = std::lround(pixel.x()), v = std::lround(pixel.y());
    const pcl::Normal& normal = all[v * frame.width + u];
    if (!std::isfinite(normal.normal_x)) continue;
    kept->push_back(point);
    normals->push_back(normal);
  }
  points = kept;
  return normals;
}

std::vector<Tube> cylinders_of(const Cloud::Ptr& cloud, const Normals::Ptr& normals, const Intrinsics& camera) {
  std::vector<Tube> tubes;
  for (int i = 0; i < kMostCylinders && cloud->size() >= kLeastPoints; ++i) {
    Cylinder cylinder;
    pcl::PointIndices inliers;
    if (!next_cylinder(cloud, normals, cylinder, inliers)) break;
    std::vector<Eigen::Vector3d> points;
    std::vector<bool> taken(cloud->size(), false);
    for (const int index : inliers.indices) {
      const auto place = static_cast<std::size_t>(index);
      points.emplace_back((*cloud)[place].getVector3fMap().cast<double>());
      taken[place] = true;
    }
    for (const Tube& piece : straight_pieces(cylinder, points, camera.fx_px)) tubes.push_back(piece);
    drop(*cloud, taken);
    drop(*normals, taken);
  }
  return tubes;
}

}  // namespace

std::vector<Tube> pcl_cylinders(const DepthFrame& frame, const Intrinsics& camera) {
  const Cloud::Ptr cloud = cloud_of(points_off_planes(frame, camera));
  if (cloud->size() < kLeastPoints) return {};
  return cylinders_of(cloud, pca_normals(cloud), camera);
}

std::vector<Tube> pcl_integral_cylinders(const DepthFrame& frame, const Intrinsics& camera) {
  Cloud::Ptr cloud = cloud_of(points_off_planes(frame, camera));
  if (cloud->size() < kLeastPoints) return {};
  const Normals::Ptr normals = integral_normals(frame, camera, cloud);
  return cylinders_of(cloud, normals, camera);
}

}  // namespace tubetrack::bench
