#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tubetrack/heightmap/plane_map.hpp"

namespace tubetrack {

namespace {

constexpr int kSquare_px = 16;
constexpr double kNearPlane = 0.01;   // of the depth: so far off is still in it
constexpr double kLikeNormal = 0.97;  // 14°

/// Least squares for a, b, c in 1/z = a x + b y + c, which is the plane (a, b, c) · p = 1.
struct PlaneSums {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int count = 0;

  void add(const Eigen::Vector2f& ray, double depth_m) {
    const Eigen::Vector3d row(ray.x(), ray.y(), 1.0);
    matrix += row * row.transpose();
    right += row / depth_m;
    ++count;
  }
  std::optional<SupportPlane> plane() const {
    const Eigen::Vector3d factors = matrix.ldlt().solve(right);
    const double length = factors.norm();
    if (!(length > 1e-6) || !factors.allFinite()) return std::nullopt;
    return SupportPlane{factors / length, 1.0 / length};
  }
};

/// A square of the image: its readings' plane and a point of that in its middle.
struct Square {
  PlaneSums sums;
  SupportPlane plane;
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
};

std::vector<Square> squares_of(const HeightMap& map) {
  constexpr int kEnough = kSquare_px * kSquare_px * 3 / 4;
  std::vector<Square> squares;
  for (int top = 0; top + kSquare_px <= map.intrinsics.height; top += kSquare_px) {
    for (int left = 0; left + kSquare_px <= map.intrinsics.width; left += kSquare_px) {
      Square square;
      for (int v = top; v < top + kSquare_px; ++v) {
        for (int u = left; u < left + kSquare_px; ++u) {
          const std::size_t cell = map.cell(u, v);
          if (map.depth_m[cell] > 0.0F) square.sums.add(map.rays[cell], map.depth_m[cell]);
        }
      }
      const auto plane = square.sums.count >= kEnough ? square.sums.plane() : std::nullopt;
      if (!plane) continue;
      const Eigen::Vector2f& ray = map.rays[map.cell(left + kSquare_px / 2, top + kSquare_px / 2)];
      const Eigen::Vector3d direction(ray.x(), ray.y(), 1.0);
      square.plane = *plane;
      square.middle_m = plane->distance_m / plane->normal.dot(direction) * direction;
      if (square.middle_m.allFinite() && square.middle_m.z() > 0.0) squares.push_back(square);
    }
  }
  return squares;
}

bool lies_in(const Square& square, const SupportPlane& plane) {
  return std::abs(plane.normal.dot(square.middle_m) - plane.distance_m) < kNearPlane * square.middle_m.z() &&
         square.plane.normal.dot(plane.normal) > kLikeNormal;
}

}  // namespace

std::optional<SupportPlane> largest_plane(const HeightMap& map) {
  const std::vector<Square> squares = squares_of(map);
  const auto members = [&](const SupportPlane& plane) {
    return std::count_if(squares.begin(), squares.end(), [&](const Square& square) { return lies_in(square, plane); });
  };
  SupportPlane best;
  std::ptrdiff_t most = 0;
  for (const Square& square : squares) {
    const auto count = members(square.plane);
    if (count <= most) continue;
    most = count;
    best = square.plane;
  }
  if (most == 0 || 10 * most < static_cast<std::ptrdiff_t>(squares.size())) return std::nullopt;
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    PlaneSums all;
    for (const Square& square : squares) {
      if (!lies_in(square, best)) continue;
      all.matrix += square.sums.matrix;
      all.right += square.sums.right;
    }
    const auto fitted = all.plane();
    if (!fitted) break;
    best = *fitted;
  }
  return best;
}

}  // namespace tubetrack
