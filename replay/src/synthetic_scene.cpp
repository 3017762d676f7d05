#include "tubetrack/replay/synthetic_scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tubetrack {

TubePart TubePart::straight(double length_m) {
  return {Type::straight, length_m, 0.0, 0.0, 0.0};
}

TubePart TubePart::arc(double bend_radius_m, double angle_rad, double rotation_rad) {
  return {Type::arc, 0.0, bend_radius_m, angle_rad, rotation_rad};
}

Eigen::Isometry3d motion_at(const Motion& motion, double time_s) {
  Eigen::Isometry3d now = Eigen::Isometry3d::Identity();
  const double rate = motion.angular_velocity_rad_s.norm();
  now.translate(motion.velocity_m_s * time_s + motion.center_m);
  if (rate > 0.0) now.rotate(Eigen::AngleAxisd(rate * time_s, motion.angular_velocity_rad_s / rate));
  now.translate(-motion.center_m);
  return now;
}

double frame_time_s(const Scene& scene, int frame) {
  return std::round(1e6 * frame / scene.frames_per_second) / 1e6;
}

namespace {

/// Cubic Hermite between b and c with Catmull-Rom slopes for keys at uneven times; s from 0 to 1.
Eigen::Vector3d catmull_rom(const std::array<Eigen::Vector3d, 4>& p, const std::array<double, 4>& t, double s) {
  const double step = t[2] - t[1];
  const auto slope = [&](int i, int j) -> Eigen::Vector3d {
    return t[j] > t[i] ? Eigen::Vector3d((p[j] - p[i]) / (t[j] - t[i]) * step) : Eigen::Vector3d::Zero();
  };
  const Eigen::Vector3d at_start = slope(0, 2);
  const Eigen::Vector3d at_end = slope(1, 3);
  const double s2 = s * s;
  const double s3 = s2 * s;
  return (2.0 * s3 - 3.0 * s2 + 1.0) * p[1] + (s3 - 2.0 * s2 + s) * at_start + (3.0 * s2 - 2.0 * s3) * p[2] +
         (s3 - s2) * at_end;
}

CameraKey camera_at(const std::vector<CameraKey>& path, double time_s) {
  if (time_s <= path.front().time_s) return path.front();
  if (time_s >= path.back().time_s) return path.back();
  std::size_t next = 1;
  while (path[next].time_s < time_s) ++next;
  const std::array<const CameraKey*, 4> k{&path[next >= 2 ? next - 2 : 0], &path[next - 1], &path[next],
                                          &path[std::min(next + 1, path.size() - 1)]};
  const std::array<double, 4> t{k[0]->time_s, k[1]->time_s, k[2]->time_s, k[3]->time_s};
  const double s = (time_s - t[1]) / (t[2] - t[1]);
  return {time_s, catmull_rom({k[0]->position_m, k[1]->position_m, k[2]->position_m, k[3]->position_m}, t, s),
          catmull_rom({k[0]->look_at_m, k[1]->look_at_m, k[2]->look_at_m, k[3]->look_at_m}, t, s)};
}

}  // namespace

Eigen::Isometry3d world_from_camera(const Scene& scene, int frame) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (scene.camera_path.empty()) return pose;
  const CameraKey key = camera_at(scene.camera_path, frame_time_s(scene, frame));
  const Eigen::Vector3d forward = (key.look_at_m - key.position_m).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(forward).normalized();
  pose.linear().col(0) = right;
  pose.linear().col(1) = forward.cross(right);
  pose.linear().col(2) = forward;
  pose.translation() = key.position_m;
  return pose;
}

}  // namespace tubetrack
