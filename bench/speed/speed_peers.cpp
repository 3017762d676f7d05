#include "speed_peers.hpp"

#if defined(TUBETRACK_PEER_PCL) || defined(TUBETRACK_PEER_CGAL) || defined(TUBETRACK_PEER_OPENCV)
#include "peers.hpp"
#endif

namespace tubetrack::bench {

namespace {

#if defined(TUBETRACK_PEER_PCL) || defined(TUBETRACK_PEER_CGAL)
using Find = std::vector<Tube> (*)(const DepthFrame&, const Intrinsics&);

PeerContender detector(const char* name, const char* does, Find find, const Intrinsics& camera) {
  auto tubes = std::make_shared<std::vector<double>>();
  const auto run = [find, camera, tubes](const DepthFrame& frame) {
    tubes->push_back(static_cast<double>(find(frame, camera).size()));
  };
  return {{name, run}, does, false, true, tubes};
}
#endif

#ifdef TUBETRACK_PEER_OPENCV
PeerContender normals(const char* name, const char* does, OpencvNormals method, const Intrinsics& camera) {
  NormalsOfPoints work = opencv_normals(camera, method);
  Contender contender{name, [run = work.run](const DepthFrame&) { run(); }, work.prepare};
  return {std::move(contender), does, method == OpencvNormals::fals, method == OpencvNormals::sri};
}
#endif

}  // namespace

std::vector<PeerContender> speed_peers([[maybe_unused]] const Intrinsics& camera) {
  std::vector<PeerContender> peers;
#ifdef TUBETRACK_PEER_OPENCV
  peers.push_back(normals("OpenCV FALS", "normals alone, 7 × 7, from points", OpencvNormals::fals, camera));
  peers.push_back(normals("OpenCV SRI", "normals alone, 7 × 7, from points", OpencvNormals::sri, camera));
#endif
#ifdef TUBETRACK_PEER_PCL
  peers.push_back(detector("PCL, integral image", "planes out, integral-image normals, SAC cylinder, straight pieces",
                           pcl_integral_cylinders, camera));
  peers.push_back(detector("PCL, PCA", "planes out, PCA normals of 50 neighbours, SAC cylinder, straight pieces",
                           pcl_cylinders, camera));
#endif
#ifdef TUBETRACK_PEER_CGAL
  peers.push_back(
      detector("CGAL Efficient RANSAC", "planes out, jet normals of 50 neighbours, cylinders", cgal_cylinders, camera));
#endif
  return peers;
}

}  // namespace tubetrack::bench
