#include "tubetrack/report/cramer_rao.hpp"

#include <gmock/gmock.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <optional>

namespace tubetrack {
namespace {

using testing::DoubleNear;

constexpr double kFocal_px = 570.0;
constexpr double kDepth_m = 0.8;
constexpr double kRadius_m = 0.02;
constexpr int kColumns = 40;

/// Depth at which the ray (x, y, 1) meets a cylinder along x.
std::optional<double> depth_of(double y, double center_y_m, double center_z_m, double radius_m) {
  const double a = y * y + 1.0;
  const double b = center_y_m * y + center_z_m;
  const double c = center_y_m * center_y_m + center_z_m * center_z_m - radius_m * radius_m;
  if (b * b < a * c) return std::nullopt;
  return (b - std::sqrt(b * b - a * c)) / a;
}

/// A straight tube along x, seen in `kColumns` columns; the same rows in each.
std::vector<SurfacePixel> pixels_of_a_tube() {
  std::vector<SurfacePixel> pixels;
  for (int u = 0; u < kColumns; ++u) {
    for (int v = -30; v <= 30; ++v) {
      const auto depth_m = depth_of(v / kFocal_px, 0.0, kDepth_m, kRadius_m);
      if (!depth_m) continue;
      SurfacePixel pixel;
      pixel.point_m = *depth_m * Eigen::Vector3d(0.0, v / kFocal_px, 1.0);
      pixel.normal = Eigen::Vector3d(0.0, pixel.point_m.y(), pixel.point_m.z() - kDepth_m) / kRadius_m;
      pixel.from_start_m = 0.001 * u;
      pixels.push_back(pixel);
    }
  }
  return pixels;
}

/// The same by differences of depths instead of derivatives: covariance of (y, z, radius).
Eigen::Matrix3d covariance_by_differences(const std::vector<SurfacePixel>& pixels) {
  constexpr double kStep_m = 1e-6;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const SurfacePixel& pixel : pixels) {
    const double y = pixel.point_m.y() / pixel.point_m.z();
    const double incidence = std::acos(-pixel.normal.dot(pixel.point_m.normalized()));
    if (incidence > 75.0 / 180.0 * std::acos(-1.0)) continue;
    const auto by = [&](double dy, double dz, double dr) {
      const auto more = depth_of(y, dy, kDepth_m + dz, kRadius_m + dr);
      const auto less = depth_of(y, -dy, kDepth_m - dz, kRadius_m - dr);
      return (*more - *less) / (2.0 * kStep_m);
    };
    const Eigen::Vector3d derivative(by(kStep_m, 0.0, 0.0), by(0.0, kStep_m, 0.0), by(0.0, 0.0, kStep_m));
    const double sigma_m = depth_sigma_m({}, pixel.point_m.z(), incidence, kFocal_px);
    information += derivative * derivative.transpose() / (sigma_m * sigma_m);
  }
  return information.inverse();
}

TEST(CramerRao, OnePieceIsWhatDifferencesOfDepthsGive) {
  const std::vector<SurfacePixel> pixels = pixels_of_a_tube();
  const TubeBound bound = cramer_rao_bound(pixels, 1.0, {}, kFocal_px);
  const Eigen::Matrix3d covariance = covariance_by_differences(pixels);
  const Eigen::Matrix2d place = covariance.topLeftCorner<2, 2>();
  const double larger_m2 = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(place).eigenvalues()[1];
  ASSERT_EQ(bound.pieces.size(), 1U);
  EXPECT_THAT(bound.pieces[0].sigma_m / std::sqrt(larger_m2), DoubleNear(1.0, 1e-3));
  EXPECT_THAT(bound.pieces[0].rms_m / std::sqrt(place.trace()), DoubleNear(1.0, 1e-3));
  EXPECT_THAT(bound.radius_sigma_m / std::sqrt(covariance(2, 2)), DoubleNear(1.0, 1e-3));
}

TEST(CramerRao, EveryPieceTellsOfTheOneRadius) {
  const std::vector<SurfacePixel> pixels = pixels_of_a_tube();
  const TubeBound whole = cramer_rao_bound(pixels, 1.0, {}, kFocal_px);
  const TubeBound pieces = cramer_rao_bound(pixels, 0.010, {}, kFocal_px);
  ASSERT_EQ(pieces.pieces.size(), 4U);
  EXPECT_THAT(pieces.radius_sigma_m / whole.radius_sigma_m, DoubleNear(1.0, 1e-6));
  for (const PieceBound& piece : pieces.pieces) {
    EXPECT_GT(piece.sigma_m, whole.pieces[0].sigma_m);
    // Alone, with its own radius, a quarter of the pixels would make it twice as large.
    EXPECT_LT(piece.sigma_m, 2.0 * whole.pieces[0].sigma_m);
  }
}

TEST(CramerRao, TwiceThePixelsAreWorthASquareRootOfTwo) {
  std::vector<SurfacePixel> pixels = pixels_of_a_tube();
  const TubeBound once = cramer_rao_bound(pixels, 1.0, {}, kFocal_px);
  const std::vector<SurfacePixel> again = pixels;
  pixels.insert(pixels.end(), again.begin(), again.end());
  const TubeBound twice = cramer_rao_bound(pixels, 1.0, {}, kFocal_px);
  EXPECT_THAT(once.pieces[0].sigma_m / twice.pieces[0].sigma_m, DoubleNear(std::sqrt(2.0), 1e-6));
  EXPECT_THAT(once.radius_sigma_m / twice.radius_sigma_m, DoubleNear(std::sqrt(2.0), 1e-6));
}

TEST(CramerRao, OneLineOfPixelsTellsNothing) {
  std::vector<SurfacePixel> pixels;
  for (const SurfacePixel& pixel : pixels_of_a_tube()) {
    if (pixel.point_m.y() == 0.0) pixels.push_back(pixel);
  }
  const TubeBound bound = cramer_rao_bound(pixels, 1.0, {}, kFocal_px);
  ASSERT_EQ(bound.pieces.size(), 1U);
  EXPECT_TRUE(std::isinf(bound.pieces[0].sigma_m));
  EXPECT_TRUE(std::isinf(bound.radius_sigma_m));
  EXPECT_TRUE(cramer_rao_bound({}, 1.0, {}, kFocal_px).pieces.empty());
}

}  // namespace
}  // namespace tubetrack
