#include "methods.hpp"

#if defined(TUBETRACK_PEER_PCL) || defined(TUBETRACK_PEER_CGAL)
#include "peers.hpp"
#endif

namespace tubetrack::bench {

namespace {

using Find = std::vector<Tube> (*)(const DepthFrame&, const Intrinsics&);

/// Peers know the camera's frame alone; where there are poses their tubes go to the world.
[[maybe_unused]] Method peer_method(const char* name, Find find) {
  const auto start = [find](const Intrinsics& camera) -> Detector {
    return [find, camera](const DepthFrame& frame) {
      TubeFrame result;
      result.timestamp_s = frame.timestamp_s;
      result.tubes = find(frame, camera);
      if (frame.world_from_camera) {
        result.frame_id = "world";
        for (Tube& tube : result.tubes) {
          for (Eigen::Vector3d& point : tube.centerline_m) point = *frame.world_from_camera * point;
        }
      }
      for (std::size_t i = 0; i < result.tubes.size(); ++i) result.tubes[i].id = static_cast<std::int64_t>(i) + 1;
      result.status = result.tubes.empty() ? TrackStatus::empty : TrackStatus::ok;
      return result;
    };
  };
  return {name, start, false};
}

}  // namespace

std::vector<Method> peer_methods() {
  std::vector<Method> methods;
#ifdef TUBETRACK_PEER_PCL
  methods.push_back(peer_method("PCL", pcl_cylinders));
#endif
#ifdef TUBETRACK_PEER_CGAL
  methods.push_back(peer_method("CGAL", cgal_cylinders));
#endif
  return methods;
}

}  // namespace tubetrack::bench
