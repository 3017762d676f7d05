#include "hide.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "shape_sums.hpp"

namespace tubetrack {

namespace {

void take_out(HeightMap& map, std::size_t cell, HiddenCells& hidden) {
  if (map.depth_m[cell] <= 0.0F) return;
  map.depth_m[cell] = -map.depth_m[cell];
  hidden.push_back(static_cast<std::uint32_t>(cell));
}

/// At a silhouette the sensor's lateral jitter mixes what is in front with what is behind.
void take_out_around(HeightMap& map, std::uint32_t cell, HiddenCells& hidden) {
  constexpr int kReach_px = 1;
  const int width = map.intrinsics.width;
  const int u = static_cast<int>(cell) % width;
  const int v = static_cast<int>(cell) / width;
  for (int row = std::max(0, v - kReach_px); row <= std::min(map.intrinsics.height - 1, v + kReach_px); ++row) {
    for (int col = std::max(0, u - kReach_px); col <= std::min(width - 1, u + kReach_px); ++col) {
      take_out(map, map.cell(col, row), hidden);
    }
  }
}

/// An end of the extent, and the direction out of it.
struct End {
  Eigen::Vector3d at_m, out;
};
std::array<End, 2> ends_of(const FollowedTube& tube) {
  const Spline& spline = tube.model.spline;
  return {End{point_at(spline, tube.extent.t_begin), -derivative_at(spline, tube.extent.t_begin).normalized()},
          End{point_at(spline, tube.extent.t_end), derivative_at(spline, tube.extent.t_end).normalized()}};
}

/// About where in the image a tube is, by its control points, which the line lies between; so much more around it.
/// Empty where it comes up to the camera.
using Box = Eigen::AlignedBox2d;
std::optional<Box> box_of(const Intrinsics& in, const TubeModel& model, double more_radii, double more_px) {
  Box box;
  for (const Eigen::Vector3d& control : model.spline.control_m) {
    const double nearest_m = control.z() - model.radius_m;
    if (nearest_m < 0.02) return std::nullopt;
    const double reach_px = (1.0 + more_radii) * model.radius_m * std::max(in.fx_px, in.fy_px) / nearest_m + more_px;
    const Eigen::Vector2d at = project(in, control);
    box.extend(Box(at.array() - reach_px, at.array() + reach_px));
  }
  return box;
}

/// Is the other so far beside a tube that is followed that nothing of it is looked at: not beside the tube, nor where
/// it may have gone since the last frame?
bool is_apart(const Intrinsics& in, const FollowedTube& tube, const FollowedTube& other) {
  constexpr double kBesideRadii = 3.0;
  constexpr double kMoved_px = 32.0;
  if (!other.model.profile.offset_m.empty() || !tube.model.profile.offset_m.empty()) return false;
  const auto own = box_of(in, tube.model, kBesideRadii, kMoved_px);
  const auto others = box_of(in, other.model, 0.0, 2.0);
  return own && others && !own->intersects(*others);
}

}  // namespace

bool in_one_line(const FollowedTube& a, const FollowedTube& b) {
  for (const End& from : ends_of(a)) {
    for (const End& to : ends_of(b)) {
      const Eigen::Vector3d way = to.at_m - from.at_m;
      const double aside_m = (way - way.dot(from.out) * from.out).norm();
      if (aside_m < 0.7 * a.model.radius_m && from.out.dot(to.out) < -0.9) return true;
    }
  }
  return false;
}

void hide_from(const SeenTube* mine, const SeenTube& other, HeightMap& map, HiddenCells& hidden) {
  const std::size_t own = mine ? mine->pixels.size() : 0;
  std::size_t at = 0;
  for (const PredictedPixel& pixel : other.pixels) {
    if (pixel.t < other.extent.t_begin || pixel.t > other.extent.t_end) continue;
    const float depth_m = map.depth_m[pixel.cell];
    const double behind_m = depth_m - pixel.depth_m;
    const double agreement = agreement_m(other.model, pixel);
    if (depth_m > 0.0F && behind_m < -agreement) continue;  // something nearer hides it here
    const bool agrees = depth_m > 0.0F && behind_m <= agreement;
    const bool on_outline = pixel.margin_px < 1.0F;
    if (!agrees && !on_outline) continue;
    while (at < own && mine->pixels.cell[at] < pixel.cell) ++at;
    const bool in_front = at < own && mine->pixels.cell[at] == pixel.cell &&
                          mine->pixels.depth_m[at] <= pixel.depth_m && mine->pixels.t[at] >= mine->extent.t_begin &&
                          mine->pixels.t[at] <= mine->extent.t_end;
    if (in_front) continue;
    if (agrees) take_out(map, pixel.cell, hidden);
    if (on_outline) take_out_around(map, pixel.cell, hidden);
  }
}

void hide_beside_gaps(const SeenTube& mine, const TrackerConfig& config, HeightMap& map, HiddenCells& hidden) {
  if (config.varying_radius) return;
  constexpr float kOwnEdge_px = 1.5F;  // nearer to the silhouette readings are missing for its sake, and not fitted
  const PredictedPixels& pixels = mine.pixels;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (map.depth_m[pixels.cell[i]] != 0.0F) continue;
    if (pixels.margin_px[i] < kOwnEdge_px || pixels.cos_incidence[i] < kCos75) continue;
    if (pixels.t[i] < mine.extent.t_begin || pixels.t[i] > mine.extent.t_end) continue;
    take_out_around(map, pixels.cell[i], hidden);
  }
}

void hide_others(std::span<const FollowedTube> tubes, const FollowedTube* self, const SeenTube* mine, HeightMap& map,
                 HiddenCells& hidden) {
  for (const FollowedTube& other : tubes) {
    if (&other == self || other.state != TubeState::tracked) continue;
    if (self && ((self->confirmed && !other.confirmed) || in_one_line(*self, other))) continue;
    if (self && is_apart(map.intrinsics, *self, other)) continue;
    hide_from(mine, seen(other), map, hidden);
  }
}

void show_again(HeightMap& map, HiddenCells& hidden) {
  for (const std::uint32_t cell : hidden) map.depth_m[cell] = -map.depth_m[cell];
  hidden.clear();
}

}  // namespace tubetrack
