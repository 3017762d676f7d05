#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {

namespace {

/// A short straight piece of the tube and the part of the image that it can cover.
struct Piece {
  Eigen::Vector3d start_m;
  Eigen::Vector3d axis;  ///< unit
  double length_m = 0.0;
  double t_start = 0.0;
  double t_length = 0.0;
  int u_begin = 0, u_end = 0, v_begin = 0, v_end = 0;
};

bool place_in_image(const Intrinsics& in, double radius_m, const Eigen::Vector3d& end_m, Piece& piece) {
  const double near = std::min(piece.start_m.z(), end_m.z()) - radius_m;
  if (near < 0.02) return false;
  double u_min = 1e9, u_max = -1e9, v_min = 1e9, v_max = -1e9;
  for (const Eigen::Vector3d& point : {piece.start_m, end_m}) {
    for (const Eigen::Vector3d& side :
         {Eigen::Vector3d(radius_m, radius_m, 0.0), Eigen::Vector3d(-radius_m, -radius_m, 0.0)}) {
      for (const double depth : {point.z() - radius_m, point.z() + radius_m}) {
        const Eigen::Vector2d pixel = project(in, Eigen::Vector3d(point.x() + side.x(), point.y() + side.y(), depth));
        u_min = std::min(u_min, pixel.x());
        u_max = std::max(u_max, pixel.x());
        v_min = std::min(v_min, pixel.y());
        v_max = std::max(v_max, pixel.y());
      }
    }
  }
  const auto clamp = [](double value, int high) { return static_cast<int>(std::clamp(value, 0.0, 1.0 * high)); };
  piece.u_begin = clamp(u_min - 1.0, in.width);
  piece.u_end = clamp(u_max + 2.0, in.width);
  piece.v_begin = clamp(v_min - 1.0, in.height);
  piece.v_end = clamp(v_max + 2.0, in.height);
  return piece.u_begin < piece.u_end && piece.v_begin < piece.v_end;
}

/// The nearer intersection of the ray z·(x, y, 1) with a piece; nothing where it misses.
std::optional<PredictedPixel> intersect(const Piece& piece, double radius_m, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d ray_across = ray - ray.dot(piece.axis) * piece.axis;
  const Eigen::Vector3d start_across = piece.start_m - piece.start_m.dot(piece.axis) * piece.axis;
  const double a = ray_across.squaredNorm();
  const double b = ray_across.dot(start_across);
  const double discriminant = b * b - a * (start_across.squaredNorm() - radius_m * radius_m);
  if (a < 1e-12 || discriminant <= 0.0) return std::nullopt;
  const double z = (b - std::sqrt(discriminant)) / a;
  if (z <= 0.0) return std::nullopt;
  const Eigen::Vector3d hit = z * ray;
  const double along = (hit - piece.start_m).dot(piece.axis);
  const double slack = 0.15 * piece.length_m;  // closes the wedge outside a bend
  if (along < -slack || along > piece.length_m + slack) return std::nullopt;
  const Eigen::Vector3d normal = (hit - piece.start_m - along * piece.axis) / radius_m;
  const double inside = std::sqrt(std::max(0.0, start_across.squaredNorm() - b * b / a)) / radius_m;
  const double side = start_across.cross(ray_across).dot(piece.axis) > 0.0 ? 1.0 : -1.0;
  PredictedPixel pixel;
  pixel.depth_m = static_cast<float>(z);
  pixel.t = static_cast<float>(piece.t_start + along / piece.length_m * piece.t_length);
  pixel.cos_incidence = static_cast<float>(-normal.dot(ray) / ray.norm());
  pixel.lateral = static_cast<float>(side * inside);
  pixel.axis_depth_m = static_cast<float>(b / a);
  pixel.across = static_cast<float>(std::sqrt(a));
  return pixel;
}

}  // namespace

std::vector<PredictedPixel> predict_pixels(const HeightMap& map, const TubeModel& model) {
  std::vector<PredictedPixel> pixels;
  const int pieces = static_cast<int>(2.0 * model.spline.spans());
  Eigen::Vector3d from = point_at(model.spline, 0.0);
  for (int i = 0; i < pieces; ++i) {
    const Eigen::Vector3d to = point_at(model.spline, 0.5 * (i + 1));
    Piece piece;
    piece.start_m = from;
    piece.length_m = (to - from).norm();
    piece.t_start = 0.5 * i;
    piece.t_length = 0.5;
    from = to;
    if (piece.length_m < 1e-6) continue;
    piece.axis = (to - piece.start_m) / piece.length_m;
    if (!place_in_image(map.intrinsics, model.radius_m, to, piece)) continue;
    for (int v = piece.v_begin; v < piece.v_end; ++v) {
      for (int u = piece.u_begin; u < piece.u_end; ++u) {
        const std::size_t at = map.cell(u, v);
        auto pixel = intersect(piece, model.radius_m, Eigen::Vector3d(map.rays[at].x(), map.rays[at].y(), 1.0));
        if (!pixel) continue;
        pixel->cell = static_cast<std::uint32_t>(at);
        pixels.push_back(*pixel);
      }
    }
  }
  std::sort(pixels.begin(), pixels.end(), [](const PredictedPixel& a, const PredictedPixel& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.depth_m < b.depth_m;
  });
  const auto same_cell = [](const PredictedPixel& a, const PredictedPixel& b) { return a.cell == b.cell; };
  pixels.erase(std::unique(pixels.begin(), pixels.end(), same_cell), pixels.end());
  return pixels;
}

double predicted_sigma_m(const HeightMap& map, const NoiseModel& noise, const PredictedPixel& pixel) {
  return depth_sigma_m(noise, pixel.depth_m, std::acos(std::clamp(static_cast<double>(pixel.cos_incidence), 0.0, 1.0)),
                       map.intrinsics.fx_px);
}

std::vector<Observation> select_observations(const HeightMap& map, const NoiseModel& noise,
                                             const std::vector<PredictedPixel>& predicted, double gate_m,
                                             double gate_sigmas) {
  constexpr float kCos75 = 0.2588F;
  std::vector<Observation> observations;
  observations.reserve(predicted.size());
  for (const PredictedPixel& pixel : predicted) {
    const float measured = map.depth_m[pixel.cell];
    if (measured <= 0.0F || pixel.cos_incidence < kCos75) continue;
    const double sigma = predicted_sigma_m(map, noise, pixel);
    if (std::abs(measured - pixel.depth_m) > gate_m + gate_sigmas * sigma) continue;
    const Eigen::Vector3d ray(map.rays[pixel.cell].x(), map.rays[pixel.cell].y(), 1.0);
    observations.push_back({measured * ray, ray.normalized(), sigma * ray.norm(), pixel.t});
  }
  return observations;
}

}  // namespace tubetrack
