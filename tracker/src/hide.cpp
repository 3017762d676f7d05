#include "hide.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

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

/// How far around a followed tube the image is looked at: what lies beside it, and where it may have gone since the
/// last frame. One that rests is found within a radius of where it was.
struct Reach {
  double radii = 0.0;
  double px = 0.0;
};
Reach reach_of(const FollowedTube& tube) {
  return tube.at_rest ? Reach{2.0, 4.0} : Reach{3.0, 32.0};
}

/// About where in the image some of a tube's control points are, which the line lies between; so much more around it.
/// Empty where it comes up to the camera.
using Box = Eigen::AlignedBox2d;
std::optional<Box> box_of(const Intrinsics& in, std::span<const Eigen::Vector3d> control_m, double radius_m,
                          const Reach& more) {
  Box box;
  for (const Eigen::Vector3d& control : control_m) {
    const double nearest_m = control.z() - radius_m;
    if (nearest_m < 0.02) return std::nullopt;
    const double reach_px = (1.0 + more.radii) * radius_m * std::max(in.fx_px, in.fy_px) / nearest_m + more.px;
    const Eigen::Vector2d at = project(in, control);
    box.extend(Box(at.array() - reach_px, at.array() + reach_px));
  }
  return box;
}

/// Is the other so far beside a tube that is followed that nothing of it is looked at?
bool is_apart(const Intrinsics& in, const FollowedTube& tube, const FollowedTube& other) {
  if (!other.model.profile.offset_m.empty() || !tube.model.profile.offset_m.empty()) return false;
  const auto own = box_of(in, tube.model.spline.control_m, tube.model.radius_m, reach_of(tube));
  const auto others = box_of(in, other.model.spline.control_m, other.model.radius_m, {0.0, 2.0});
  return own && others && !own->intersects(*others);
}

/// Where a followed tube is looked at: from which cell to below which, row by row.
struct Cells {
  std::uint32_t begin = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t end = 0;
};
using Surroundings = RecycledVector<Cells>;

/// Empty where that may be anywhere.
Surroundings surroundings_of(const HeightMap& map, const FollowedTube& tube) {
  const Intrinsics& in = map.intrinsics;
  if (!tube.model.profile.offset_m.empty()) return {};
  const std::span<const Eigen::Vector3d> control_m = tube.model.spline.control_m;
  Surroundings rows(static_cast<std::size_t>(in.height));
  for (std::size_t k = 0; k + 3 < control_m.size(); ++k) {
    const auto box = box_of(in, control_m.subspan(k, 4), tube.model.radius_m, reach_of(tube));
    if (!box) return {};
    const auto pixel = [](double at, int size) { return static_cast<int>(std::clamp(at, 0.0, 1.0 * size)); };
    const int left = pixel(box->min().x(), in.width), right = pixel(box->max().x() + 1.0, in.width);
    const int top = pixel(box->min().y(), in.height), bottom = pixel(box->max().y() + 1.0, in.height);
    for (int v = top; v < bottom; ++v) {
      Cells& row = rows[static_cast<std::size_t>(v)];
      row.begin = std::min(row.begin, static_cast<std::uint32_t>(map.cell(left, v)));
      row.end = std::max(row.end, static_cast<std::uint32_t>(map.cell(right, v)));
    }
  }
  return rows;
}

/// `hide_from` for the other's pixels from one to below another. `at`: how far `mine` was compared; they come in order.
void hide_run(const SeenTube* mine, const SeenTube& other, std::size_t begin, std::size_t end, std::size_t& at,
              HeightMap& map, HiddenCells& hidden) {
  const std::size_t own = mine ? mine->pixels.size() : 0;
  const PredictedPixels& pixels = other.pixels;
  for (std::size_t i = begin; i < end; ++i) {
    if (pixels.t[i] < other.extent.t_begin || pixels.t[i] > other.extent.t_end) continue;
    const std::uint32_t cell = pixels.cell[i];
    const float depth_m = map.depth_m[cell];
    const double behind_m = depth_m - pixels.depth_m[i];
    const double agreement = agreement_m(other.model, pixels.sigma_m[i]);
    if (depth_m > 0.0F && behind_m < -agreement) continue;  // something nearer hides it here
    const bool agrees = depth_m > 0.0F && behind_m <= agreement;
    const bool on_outline = pixels.margin_px[i] < 1.0F;
    if (!agrees && !on_outline) continue;
    while (at < own && mine->pixels.cell[at] < cell) ++at;
    const bool in_front = at < own && mine->pixels.cell[at] == cell && mine->pixels.depth_m[at] <= pixels.depth_m[i] &&
                          mine->pixels.t[at] >= mine->extent.t_begin && mine->pixels.t[at] <= mine->extent.t_end;
    if (in_front) continue;
    if (agrees) take_out(map, cell, hidden);
    if (on_outline) take_out_around(map, cell, hidden);
  }
}

/// `hide_from` for those pixels of the other that lie in the surroundings.
void hide_within(const Surroundings& rows, const SeenTube* mine, const SeenTube& other, HeightMap& map,
                 HiddenCells& hidden) {
  const auto& cells = other.pixels.cell;
  const std::size_t count = other.pixels.size();
  std::size_t at = 0;
  std::size_t i = 0;
  for (const Cells& row : rows) {
    if (row.begin >= row.end) continue;
    while (i < count && cells[i] < row.begin) ++i;
    const std::size_t begin = i;
    while (i < count && cells[i] < row.end) ++i;
    hide_run(mine, other, begin, i, at, map, hidden);
  }
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
  std::size_t at = 0;
  hide_run(mine, other, 0, other.pixels.size(), at, map, hidden);
}

void hide_beside_gaps(const SeenTube& mine, HeightMap& map, HiddenCells& hidden) {
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
  std::optional<Surroundings> rows;
  for (const FollowedTube& other : tubes) {
    if (&other == self || other.state != TubeState::tracked) continue;
    if (self && ((self->confirmed && !other.confirmed) || in_one_line(*self, other))) continue;
    if (self && is_apart(map.intrinsics, *self, other)) continue;
    if (self && !rows) rows = surroundings_of(map, *self);
    if (rows && !rows->empty())
      hide_within(*rows, mine, seen(other), map, hidden);
    else
      hide_from(mine, seen(other), map, hidden);
  }
}

void show_again(HeightMap& map, HiddenCells& hidden) {
  for (const std::uint32_t cell : hidden) map.depth_m[cell] = -map.depth_m[cell];
  hidden.clear();
}

}  // namespace tubetrack
