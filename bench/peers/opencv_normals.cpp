#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/rgbd.hpp>

#include "peers.hpp"

namespace tubetrack::bench {

namespace {

constexpr int kWindow_px = 7;

struct State {
  std::vector<Eigen::Vector2f> rays;
  cv::Mat points;
  cv::Mat normals;
  cv::Ptr<cv::rgbd::RgbdNormals> estimation;
};

void set_points(State& state, const DepthFrame& frame) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  for (int v = 0; v < frame.height; ++v) {
    for (int u = 0; u < frame.width; ++u) {
      const auto& ray = state.rays[static_cast<std::size_t>(v) * frame.width + u];
      const float z = frame.row(v)[u] == 0 ? none : static_cast<float>(frame.row(v)[u] * frame.metres_per_unit);
      state.points.at<cv::Vec3f>(v, u) = {ray.x() * z, ray.y() * z, z};
    }
  }
}

}  // namespace

NormalsOfPoints opencv_normals(const Intrinsics& camera, OpencvNormals method) {
  cv::setNumThreads(1);
  const cv::Matx33f k(camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1);
  auto state = std::make_shared<State>();
  state->rays = ray_table(camera);
  state->points.create(camera.height, camera.width, CV_32FC3);
  state->estimation =
      cv::rgbd::RgbdNormals::create(camera.height, camera.width, CV_32F, cv::Mat(k), kWindow_px,
                                    method == OpencvNormals::fals ? cv::rgbd::RgbdNormals::RGBD_NORMALS_METHOD_FALS
                                                                  : cv::rgbd::RgbdNormals::RGBD_NORMALS_METHOD_SRI);
  state->estimation->initialize();
  return {[state](const DepthFrame& frame) { set_points(*state, frame); },
          [state] { (*state->estimation)(state->points, state->normals); },
          [state](int u, int v) {
            const auto& n = state->normals.at<cv::Vec3f>(v, u);
            return Eigen::Vector3f(n[0], n[1], n[2]);
          }};
}

}  // namespace tubetrack::bench
