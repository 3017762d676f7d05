#include "paper_transcription.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace tubetrack::paper {

namespace {

using Eigen::Vector3d;

/// The voxel of origin + step · normal, rounded down.
VoxelIndex voxel_of(const VoteRecord& face, int step) {
  const auto at = [&](std::size_t axis) {
    return static_cast<int>(
        std::floor((face.origin[axis] + static_cast<double>(step) * face.direction[axis]) / 4096.0));
  };
  return {at(2), at(1), at(0)};
}

Vector3d normal_of(const VoteRecord& face) {
  return Vector3d(face.direction[0], face.direction[1], face.direction[2]).normalized();
}

double sign(double value) {
  return value < 0.0 ? -1.0 : 1.0;
}

Vector3d center_of(const VoxelIndex& v, double cell_m) {
  return Vector3d(v.x + 0.5, v.y + 0.5, v.z + 0.5) * cell_m;
}

VoxelIndex voxel_at(const Vector3d& point_m, double cell_m) {
  const auto at = [&](int axis) { return static_cast<int>(std::floor(point_m[axis] / cell_m)); };
  return {at(2), at(1), at(0)};
}

bool contains(const Images& images, const VoxelIndex& v) {
  const VoxelIndex& lower = images.domain_lower;
  const VoxelIndex& upper = images.domain_upper;
  return v.x >= lower.x && v.x <= upper.x && v.y >= lower.y && v.y <= upper.y && v.z >= lower.z && v.z <= upper.z;
}

void set_domain(Images& images, int margin) {
  if (images.acc_image.empty()) return;
  VoxelIndex lower = images.acc_image.begin()->first;
  VoxelIndex upper = lower;
  for (const auto& [at, votes] : images.acc_image) {
    lower = {std::min(lower.z, at.z), std::min(lower.y, at.y), std::min(lower.x, at.x)};
    upper = {std::max(upper.z, at.z), std::max(upper.y, at.y), std::max(upper.x, at.x)};
  }
  images.domain_lower = {lower.z - margin, lower.y - margin, lower.x - margin};
  images.domain_upper = {upper.z + margin, upper.y + margin, upper.x + margin};
}

/// extractPatch and getMaxCoords and patchSpaceToAccImageSpace: the voxel with most votes on a square of side
/// 2 · accRadius around centerPatch, normal to dirVect. How the square is turned is the one thing taken from our trace.
VoxelIndex patch_maximum(const Images& images, const Vector3d& center_m, const Vector3d& dir_vect,
                         const TrackSettings& settings) {
  const Vector3d e1 = dir_vect.unitOrthogonal();
  const Vector3d e2 = dir_vect.cross(e1);
  const int half = std::max(1, static_cast<int>(std::lround(settings.acc_radius_m / settings.cell_m)));
  std::map<VoxelIndex, int> patch_image;
  for (int row = -half; row <= half; ++row) {
    for (int col = -half; col <= half; ++col) {
      const VoxelIndex at = voxel_at(center_m + settings.cell_m * (col * e1 + row * e2), settings.cell_m);
      patch_image[at] = images.acc(at);
    }
  }
  // In the order of voxels, so the first of equal ones is the lowest.
  return std::max_element(patch_image.begin(), patch_image.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

}  // namespace

int Images::acc(const VoxelIndex& at) const {
  const auto found = acc_image.find(at);
  return found == acc_image.end() ? 0 : found->second;
}

Vector3d Images::dir(const VoxelIndex& at) const {
  const auto found = dir_image.find(at);
  return found == dir_image.end() ? Vector3d::Zero() : Vector3d(found->second.normalized());
}

Images accumulation_from_normal_vectors(std::span<const VoteRecord> faces, int margin, double min_norm) {
  Images images;
  for (const VoteRecord& face : faces) {
    const Vector3d normal_vector = normal_of(face);
    std::vector<VoxelIndex> visited;
    for (int step = face.first_step; step <= face.last_step; ++step) {
      const VoxelIndex current_pt = voxel_of(face, step);
      if (std::find(visited.begin(), visited.end(), current_pt) != visited.end()) continue;
      visited.push_back(current_pt);
      int& acc = images.acc_image[current_pt];
      if (acc != 0) {
        const Vector3d main_axis = images.last_vectors[current_pt].cross(normal_vector);
        if (main_axis.norm() > min_norm) {
          Vector3d& dir = images.dir_image.try_emplace(current_pt, Vector3d::Zero()).first->second;
          dir += main_axis * sign(main_axis.dot(dir));
        }
      }
      images.last_vectors[current_pt] = normal_vector;
      ++acc;
      if (acc > images.max_acc || (acc == images.max_acc && current_pt < images.max_pt)) {
        images.max_acc = acc;
        images.max_pt = current_pt;
      }
    }
  }
  set_domain(images, margin);
  return images;
}

Centerline track_patch_center(const Images& images, const VoxelIndex& start_pt, bool track_in_front,
                              const TrackSettings& settings) {
  Centerline centerline;
  bool continue_tracking = true;
  VoxelIndex current_pt = start_pt;
  Vector3d last_vect = track_in_front ? settings.dir(start_pt) : Vector3d(-settings.dir(start_pt));
  Vector3d previous_m = center_of(start_pt, settings.cell_m) - last_vect * settings.track_step_m;
  const int start_acc = images.acc(start_pt);
  while (continue_tracking && static_cast<int>(centerline.points.size()) < settings.max_points) {
    centerline.points.push_back(current_pt);
    const Vector3d current_m = center_of(current_pt, settings.cell_m);
    Vector3d dir_vect = settings.dir(current_pt);
    if (last_vect.dot(dir_vect) < 0.0) dir_vect = -dir_vect;
    // isInsideTube( accImage, currentPt, previousPt, trackStep, π/3 )
    const Vector3d step = current_m - previous_m;
    const double angle = std::atan2(step.cross(dir_vect).norm(), step.dot(dir_vect));
    continue_tracking = images.acc(current_pt) >= 0.25 * start_acc && angle <= std::numbers::pi / 3.0;
    const Vector3d center_patch_m = current_m + dir_vect * settings.track_step_m;
    if (!contains(images, voxel_at(center_patch_m, settings.cell_m))) {
      centerline.left_domain = continue_tracking;
      break;
    }
    last_vect = dir_vect;
    previous_m = current_m;
    current_pt = patch_maximum(images, center_patch_m, dir_vect, settings);
  }
  return centerline;
}

}  // namespace tubetrack::paper
