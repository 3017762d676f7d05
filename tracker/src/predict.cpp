#include "tubetrack/tracker/predict.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace tubetrack {

namespace {

/// A short straight piece of the tube, cut off by the mitre planes it shares with its neighbours.
struct Piece {
  Eigen::Vector3d start_m, end_m;
  Eigen::Vector3d axis;                    ///< unit
  Eigen::Vector3d start_across;            ///< of start_m, the part across the axis
  Eigen::Vector3d start_mitre, end_mitre;  ///< normals of the planes, per metre along this piece's axis
  double t_start = 0.0;
};

constexpr double kSpansPerPiece = 0.5;

std::vector<Piece> cut_into_pieces(const TubeModel& model) {
  const int count = static_cast<int>(std::lround(model.spline.spans() / kSpansPerPiece));
  std::vector<Piece> pieces;
  pieces.reserve(static_cast<std::size_t>(count));
  Eigen::Vector3d from = point_at(model.spline, 0.0);
  for (int i = 0; i < count; ++i) {
    Piece piece;
    piece.start_m = from;
    piece.end_m = from = point_at(model.spline, kSpansPerPiece * (i + 1));
    const double length_m = (piece.end_m - piece.start_m).norm();
    if (length_m < 1e-6) continue;
    piece.axis = (piece.end_m - piece.start_m) / length_m;
    piece.start_across = piece.start_m - piece.start_m.dot(piece.axis) * piece.axis;
    piece.t_start = kSpansPerPiece * i;
    piece.start_mitre = piece.end_mitre = piece.axis;
    pieces.push_back(piece);
  }
  for (std::size_t i = 1; i < pieces.size(); ++i) {
    const Eigen::Vector3d mitre = pieces[i - 1].axis + pieces[i].axis;
    if (mitre.squaredNorm() < 0.5) continue;  // folded back on itself: cut straight
    pieces[i - 1].end_mitre = mitre / mitre.dot(pieces[i - 1].axis);
    pieces[i].start_mitre = mitre / mitre.dot(pieces[i].axis);
  }
  return pieces;
}

/// A piece's outline in the image: a quadrangle around it, a little too large.
using Quad = std::array<Eigen::Vector2d, 4>;

/// How far a circle of the tube around `center_m` reaches in the image along a unit direction.
double reach_px(const Intrinsics& in, const Eigen::Vector3d& center_m, const Piece& piece, double radius_m,
                const Eigen::Vector2d& direction) {
  const double z = center_m.z() - radius_m;
  Eigen::Matrix<double, 2, 3> by_point;
  by_point << in.fx_px / z, 0.0, -in.fx_px * center_m.x() / (z * center_m.z()), 0.0, in.fy_px / z,
      -in.fy_px * center_m.y() / (z * center_m.z());
  const Eigen::Vector3d gradient = by_point.transpose() * direction;
  return radius_m * (gradient - gradient.dot(piece.axis) * piece.axis).norm();
}

std::optional<Quad> outline_of(const Intrinsics& in, const Piece& piece, double radius_m) {
  if (std::min(piece.start_m.z(), piece.end_m.z()) - radius_m < 0.02) return std::nullopt;
  const Eigen::Vector2d from = project(in, piece.start_m);
  const Eigen::Vector2d to = project(in, piece.end_m);
  Eigen::Vector2d along = to - from;
  along = along.norm() > 1e-6 ? Eigen::Vector2d(along.normalized()) : Eigen::Vector2d::UnitX();
  const Eigen::Vector2d side(-along.y(), along.x());
  const auto reach = [&](const Eigen::Vector3d& center, const Eigen::Vector2d& direction) {
    return 1.1 * reach_px(in, center, piece, radius_m, direction) + 1.5;
  };
  // A mitre plane that leans by an angle goes up to R tan(angle) beyond the end.
  const auto lean = [&](const Eigen::Vector3d& center, const Eigen::Vector3d& mitre) {
    return 1.1 * (mitre - piece.axis).norm() * reach_px(in, center, piece, radius_m, side);
  };
  const double back = reach(piece.start_m, along) + lean(piece.start_m, piece.start_mitre);
  const double front = reach(piece.end_m, along) + lean(piece.end_m, piece.end_mitre);
  const double from_half = reach(piece.start_m, side);
  const double to_half = reach(piece.end_m, side);
  return Quad{from - back * along - from_half * side, to + front * along - to_half * side,
              to + front * along + to_half * side, from - back * along + from_half * side};
}

/// Calls visit(u, v) for the pixels inside the outline whose coordinates are multiples of the stride.
template <class Visit>
void for_each_pixel(const Quad& quad, const Intrinsics& in, int stride, Visit&& visit) {
  const auto next_multiple = [&](double low, int size) {
    const int from = static_cast<int>(std::clamp(std::ceil(low), 0.0, 1.0 * size));
    return (from + stride - 1) / stride * stride;
  };
  double top = quad[0].y(), bottom = quad[0].y();
  for (const Eigen::Vector2d& corner : quad) {
    top = std::min(top, corner.y());
    bottom = std::max(bottom, corner.y());
  }
  const int v_begin = next_multiple(top, in.height);
  const int v_end = static_cast<int>(std::clamp(std::floor(bottom) + 1.0, 0.0, 1.0 * in.height));
  for (int v = v_begin; v < v_end; v += stride) {
    double left = 1e9, right = -1e9;
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d& a = quad[i];
      const Eigen::Vector2d& b = quad[(i + 1) % 4];
      if (std::min(a.y(), b.y()) > v || std::max(a.y(), b.y()) < v) continue;
      const double s = a.y() == b.y() ? 0.0 : (v - a.y()) / (b.y() - a.y());
      const double u = a.x() + s * (b.x() - a.x());
      left = std::min({left, u, a.y() == b.y() ? b.x() : u});
      right = std::max({right, u, a.y() == b.y() ? b.x() : u});
    }
    const int u_begin = next_multiple(left, in.width);
    const int u_end = static_cast<int>(std::clamp(std::floor(right) + 1.0, 0.0, 1.0 * in.width));
    for (int u = u_begin; u < u_end; u += stride) visit(u, v);
  }
}

/// The nearer intersection of the ray z·(x, y, 1) with a piece; false where it misses.
bool intersect(const Piece& piece, double radius_m, const Eigen::Vector3d& ray, PredictedPixel& pixel) {
  const double ray_along = ray.dot(piece.axis);
  const Eigen::Vector3d ray_across = ray - ray_along * piece.axis;
  const double a = ray_across.squaredNorm();
  const double b = ray_across.dot(piece.start_across);
  const double off2 = piece.start_across.squaredNorm();
  const double discriminant = b * b - a * (off2 - radius_m * radius_m);
  if (a < 1e-12 || discriminant <= 0.0) return false;
  const double z = (b - std::sqrt(discriminant)) / a;
  if (z <= 0.0) return false;
  const Eigen::Vector3d hit = z * ray;
  const double from_start = (hit - piece.start_m).dot(piece.start_mitre);
  const double to_end = (piece.end_m - hit).dot(piece.end_mitre);
  if (from_start < 0.0 || to_end <= 0.0) return false;
  const double side = piece.start_across.cross(ray_across).dot(piece.axis) > 0.0 ? 1.0 : -1.0;
  pixel.depth_m = static_cast<float>(z);
  pixel.t = static_cast<float>(piece.t_start + kSpansPerPiece * from_start / (from_start + to_end));
  pixel.cos_incidence =
      static_cast<float>((piece.start_across - z * ray_across).dot(ray_across) / (radius_m * ray.norm()));
  pixel.lateral = static_cast<float>(side * std::sqrt(std::max(0.0, off2 - b * b / a)) / radius_m);
  pixel.axis_depth_m = static_cast<float>(b / a);
  pixel.across = static_cast<float>(std::sqrt(a));
  return true;
}

/// The reading is of a point up to a pixel beside its ray: the mean over a curved surface lies behind the surface by
/// half its second derivative times the jitter's variance.
void add_jitter(const NoiseModel& noise, double focal_px, double radius_m, PredictedPixel& pixel) {
  const double pixel_m = pixel.depth_m / focal_px;
  const double cos_section = std::sqrt(std::max(0.1, 1.0 - 1.0 * pixel.lateral * pixel.lateral));
  const double jitter_m = noise.lateral_px * pixel_m;
  pixel.margin_px = static_cast<float>((1.0 - std::abs(pixel.lateral)) * radius_m / pixel_m);
  pixel.jitter_bias_m = static_cast<float>(0.5 * jitter_m * jitter_m /
                                           (radius_m * cos_section * cos_section * cos_section * pixel.across));
}

void sort_by_cell(std::vector<PredictedPixel>& pixels) {
  std::sort(pixels.begin(), pixels.end(), [](const PredictedPixel& a, const PredictedPixel& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.depth_m < b.depth_m;
  });
  const auto same_cell = [](const PredictedPixel& a, const PredictedPixel& b) { return a.cell == b.cell; };
  pixels.erase(std::unique(pixels.begin(), pixels.end(), same_cell), pixels.end());
}

}  // namespace

std::vector<PredictedPixel> predict_pixels(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                                           int stride) {
  std::vector<PredictedPixel> pixels;
  for (const Piece& piece : cut_into_pieces(model)) {
    const std::optional<Quad> outline = outline_of(map.intrinsics, piece, model.radius_m);
    if (!outline) continue;
    for_each_pixel(*outline, map.intrinsics, stride, [&](int u, int v) {
      PredictedPixel pixel;
      pixel.cell = static_cast<std::uint32_t>(map.cell(u, v));
      const Eigen::Vector2f& ray = map.rays[pixel.cell];
      if (!intersect(piece, model.radius_m, Eigen::Vector3d(ray.x(), ray.y(), 1.0), pixel)) return;
      add_jitter(noise, map.intrinsics.fx_px, model.radius_m, pixel);
      pixel.sigma_m = static_cast<float>(
          depth_sigma_m(noise, pixel.depth_m, std::acos(std::min(1.0F, pixel.cos_incidence)), map.intrinsics.fx_px));
      pixels.push_back(pixel);
    });
  }
  sort_by_cell(pixels);
  return pixels;
}

std::vector<Observation> select_observations(const HeightMap& map, const NoiseModel& noise,
                                             const std::vector<PredictedPixel>& predicted, double gate_m,
                                             double gate_sigmas) {
  constexpr float kCos75 = 0.2588F;
  const float margin_px = 3.0F * static_cast<float>(noise.lateral_px);
  std::vector<Observation> observations;
  observations.reserve(predicted.size());
  for (const PredictedPixel& pixel : predicted) {
    const float measured = map.depth_m[pixel.cell];
    if (measured <= 0.0F || pixel.cos_incidence < kCos75 || pixel.margin_px < margin_px) continue;
    const double reading_m = map.at_disparity_levels ? depth_of_level_m(noise, measured) : measured;
    const double depth_m = reading_m - pixel.jitter_bias_m;
    if (std::abs(depth_m - pixel.depth_m) > gate_m + gate_sigmas * pixel.sigma_m) continue;
    const Eigen::Vector3d ray(map.rays[pixel.cell].x(), map.rays[pixel.cell].y(), 1.0);
    const double norm = ray.norm();
    observations.push_back({depth_m * ray, ray / norm, pixel.sigma_m * norm, pixel.t});
  }
  return observations;
}

}  // namespace tubetrack
