#include "tubetrack/report/cramer_rao.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tubetrack {

namespace {

const double kLeastCosine = std::cos(75.0 * std::numbers::pi / 180.0);

/// Fisher information on (across, across, radius) of one piece.
struct Piece {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d along = Eigen::Vector3d::Zero();  ///< sum over its pixels
};

std::size_t piece_of(const SurfacePixel& pixel, double from_m, double piece_m) {
  return static_cast<std::size_t>((pixel.from_start_m - from_m) / piece_m);
}

/// How a pixel's depth changes when the tube is moved along `a` is normal·a / (normal·ray), with the ray's z 1; when
/// the radius grows, 1 / (normal·ray).
void add_pixel(const SurfacePixel& pixel, const NoiseModel& noise, double focal_px, Piece& piece) {
  const Eigen::Vector3d ray = pixel.point_m / pixel.point_m.z();
  const double cosine = -pixel.normal.dot(ray.normalized());
  if (cosine < kLeastCosine) return;
  const Eigen::Vector3d along = piece.along.normalized();
  const Eigen::Vector3d one = along.unitOrthogonal();
  const Eigen::Vector3d other = along.cross(one);
  const double sigma_m = depth_sigma_m(noise, pixel.point_m.z(), std::acos(std::min(cosine, 1.0)), focal_px);
  const Eigen::Vector3d derivative =
      Eigen::Vector3d(pixel.normal.dot(one), pixel.normal.dot(other), 1.0) / (pixel.normal.dot(ray) * sigma_m);
  piece.information += derivative * derivative.transpose();
}

/// What a piece says of the radius when its own place is unknown.
double radius_information(const Piece& piece) {
  const Eigen::Matrix2d place = piece.information.topLeftCorner<2, 2>();
  if (!(place.determinant() > 0.0)) return 0.0;
  const Eigen::Vector2d shared = piece.information.topRightCorner<2, 1>();
  return std::max(0.0, piece.information(2, 2) - shared.dot(place.inverse() * shared));
}

/// Covariance of a piece's place across the tube; infinite where it can't be told.
Eigen::Matrix2d place_covariance_m2(const Piece& piece, double information_from_others) {
  Eigen::Matrix3d information = piece.information;
  information(2, 2) += information_from_others;
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(information);
  if (!lu.isInvertible()) return Eigen::Matrix2d::Constant(std::numeric_limits<double>::infinity());
  return lu.inverse().topLeftCorner<2, 2>();
}

PieceBound piece_bound(const Piece& piece, double information_from_others) {
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  const Eigen::Matrix2d covariance = place_covariance_m2(piece, information_from_others);
  if (!std::isfinite(covariance(0, 0))) return {0.0, 0.0, kUnknown, kUnknown};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance, Eigen::EigenvaluesOnly);
  return {0.0, 0.0, std::sqrt(solver.eigenvalues()[1]), std::sqrt(covariance.trace())};
}

}  // namespace

TubeBound cramer_rao_bound(std::span<const SurfacePixel> pixels, double piece_m, const NoiseModel& noise,
                           double focal_px) {
  TubeBound bound;
  bound.radius_sigma_m = std::numeric_limits<double>::infinity();
  if (pixels.empty()) return bound;
  const auto [first, last] = std::ranges::minmax_element(pixels, {}, &SurfacePixel::from_start_m);
  const double from_m = first->from_start_m;
  std::vector<Piece> pieces(piece_of(*last, from_m, piece_m) + 1);
  for (const SurfacePixel& pixel : pixels) pieces[piece_of(pixel, from_m, piece_m)].along += pixel.along;
  for (const SurfacePixel& pixel : pixels) add_pixel(pixel, noise, focal_px, pieces[piece_of(pixel, from_m, piece_m)]);
  double of_radius = 0.0;
  for (const Piece& piece : pieces) of_radius += radius_information(piece);
  if (of_radius > 0.0) bound.radius_sigma_m = 1.0 / std::sqrt(of_radius);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    PieceBound piece = piece_bound(pieces[i], of_radius - radius_information(pieces[i]));
    piece.from_m = from_m + static_cast<double>(i) * piece_m;
    piece.to_m = piece.from_m + piece_m;
    bound.pieces.push_back(piece);
  }
  return bound;
}

}  // namespace tubetrack
