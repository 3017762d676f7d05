#pragma once

#include <vector>

#include "tubetrack/sensors/depth_frame.hpp"
#include "tubetrack/sensors/intrinsics.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack::bench {

// Other people's detectors of cylinders, each at its best. They give straight pieces in the camera's frame, without
// identity and without uncertainty.

/// PCL: SACSegmentationFromNormals on PCA normals, again and again on what is left.
std::vector<Tube> pcl_cylinders(const DepthFrame& frame, const Intrinsics& camera);

/// CGAL: Efficient RANSAC for cylinders on jet normals; radii out of range are dropped afterwards.
std::vector<Tube> cgal_cylinders(const DepthFrame& frame, const Intrinsics& camera);

}  // namespace tubetrack::bench
