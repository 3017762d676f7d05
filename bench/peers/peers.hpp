#pragma once

#include <functional>
#include <vector>

#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/intrinsics.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack::bench {

// Other people's detectors of cylinders, each at its best. They give straight pieces in the camera's frame, without
// identity and without uncertainty.

/// PCL: SACSegmentationFromNormals on PCA normals, again and again on what is left.
std::vector<Tube> pcl_cylinders(const DepthFrame& frame, const Intrinsics& camera);

/// PCL: the same with normals of the whole image from integral images in place of PCA.
std::vector<Tube> pcl_integral_cylinders(const DepthFrame& frame, const Intrinsics& camera);

/// CGAL: Efficient RANSAC for cylinders on jet normals; radii out of range are dropped afterwards.
std::vector<Tube> cgal_cylinders(const DepthFrame& frame, const Intrinsics& camera);

// OpenCV (opencv_rgbd) has no detector of cylinders; its normals are what others start from.

enum class OpencvNormals { fals, sri };

/// Normals of an image's points, on one thread.
struct NormalsOfPoints {
  std::function<void(const DepthFrame&)> prepare;   ///< the frame's points, NaN without return
  std::function<void()> run;                        ///< their normals
  std::function<Eigen::Vector3f(int u, int v)> at;  ///< one of them: unit, or NaN
};
NormalsOfPoints opencv_normals(const Intrinsics& camera, OpencvNormals method);

}  // namespace tubetrack::bench
