#include "tubetrack/sensors/intrinsics.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tubetrack {
namespace {

Intrinsics vga() {
  return {640, 480, 525.0, 520.0, 319.5, 239.5, {}};
}

double number_between(double low, double high) {
  return low + (high - low) * *rc::gen::inRange(0, 1'000'001) / 1'000'000.0;
}

/// A lens within what the model can undo: over the image its radius still grows with the ray's angle.
Intrinsics some_lens() {
  Intrinsics in = vga();
  in.fx_px = number_between(500.0, 650.0);
  in.fy_px = in.fx_px * number_between(0.98, 1.02);
  in.cx_px = number_between(300.0, 340.0);
  in.cy_px = number_between(220.0, 260.0);
  in.distortion = {number_between(-0.1, 0.1),     number_between(-0.04, 0.04),  number_between(-0.003, 0.003),
                   number_between(-0.003, 0.003), number_between(-0.02, 0.02),  number_between(-0.02, 0.02),
                   number_between(-0.01, 0.01),   number_between(-0.005, 0.005)};
  return in;
}

RC_GTEST_PROP(Intrinsics, ProjectUndoesNormalizedRayForAnyLens, ()) {
  const Intrinsics in = some_lens();
  const double u = number_between(0.0, in.width - 1.0);
  const double v = number_between(0.0, in.height - 1.0);
  const double depth_m = number_between(0.2, 8.0);
  const Eigen::Vector2d ray = normalized_ray(in, u, v);
  const Eigen::Vector2d back = project(in, depth_m * ray.homogeneous());
  RC_ASSERT((back - Eigen::Vector2d(u, v)).norm() < 1e-6);
}

RC_GTEST_PROP(Intrinsics, NormalizedRayUndoesProjectForAnyLens, ()) {
  const Intrinsics in = some_lens();
  const Eigen::Vector2d ray(number_between(-0.45, 0.45), number_between(-0.35, 0.35));
  const Eigen::Vector2d pixel = project(in, ray.homogeneous());
  RC_ASSERT((normalized_ray(in, pixel.x(), pixel.y()) - ray).norm() < 1e-9);
}

TEST(Intrinsics, TheStrongLensesOfTheTumCamerasAreUndoneAtEveryPixel) {
  // The published colour cameras of freiburg1 and freiburg2: strong terms that partly cancel.
  const Intrinsics lenses[] = {
      {640, 480, 517.3, 516.5, 318.6, 255.3, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633, 0.0, 0.0, 0.0}},
      {640, 480, 520.9, 521.0, 325.1, 249.7, {0.2312, -0.7849, -0.0033, -0.0001, 0.9172, 0.0, 0.0, 0.0}}};
  for (const Intrinsics& in : lenses) {
    double worst_px = 0.0;
    for (int v = 0; v < in.height; ++v) {
      for (int u = 0; u < in.width; ++u) {
        const Eigen::Vector2d back = project(in, normalized_ray(in, u, v).homogeneous());
        worst_px = std::max(worst_px, (back - Eigen::Vector2d(u, v)).norm());
      }
    }
    EXPECT_LT(worst_px, 1e-8);
  }
}

TEST(Intrinsics, DistortionIsRosAndOpenCvsModel) {
  // Worked by hand from the formula of OpenCV's calib3d documentation, at x = 0.3, y = −0.2.
  Intrinsics in = vga();
  in.distortion = {0.1, -0.05, 0.002, -0.001, 0.03, 0.02, -0.01, 0.005};
  const double r2 = 0.13;
  const double radial =
      (1 + 0.1 * r2 - 0.05 * r2 * r2 + 0.03 * r2 * r2 * r2) / (1 + 0.02 * r2 - 0.01 * r2 * r2 + 0.005 * r2 * r2 * r2);
  const double x = 0.3 * radial + 2 * 0.002 * 0.3 * -0.2 - 0.001 * (r2 + 2 * 0.09);
  const double y = -0.2 * radial + 0.002 * (r2 + 2 * 0.04) + 2 * -0.001 * 0.3 * -0.2;
  const Eigen::Vector2d pixel = project(in, {0.6, -0.4, 2.0});
  EXPECT_NEAR(pixel.x(), 525.0 * x + 319.5, 1e-9);
  EXPECT_NEAR(pixel.y(), 520.0 * y + 239.5, 1e-9);
}

TEST(Intrinsics, TheOpticalAxisMeetsThePrincipalPoint) {
  EXPECT_EQ(project(vga(), {0.0, 0.0, 1.0}), Eigen::Vector2d(319.5, 239.5));
  EXPECT_EQ(normalized_ray(vga(), 319.5, 239.5), Eigen::Vector2d(0.0, 0.0));
}

TEST(Intrinsics, XIsRightAndYIsDown) {
  EXPECT_GT(project(vga(), {0.1, 0.0, 1.0}).x(), 319.5);
  EXPECT_GT(project(vga(), {0.0, 0.1, 1.0}).y(), 239.5);
}

TEST(Intrinsics, FieldOfViewGivesTheFocalLengthAndTheCentre) {
  const Intrinsics in = intrinsics_from_field_of_view(640, 480, std::numbers::pi / 2.0, std::numbers::pi / 3.0);
  EXPECT_NEAR(in.fx_px, 320.0, 1e-9);
  EXPECT_NEAR(in.fy_px, 240.0 * std::sqrt(3.0), 1e-9);
  EXPECT_EQ(in.cx_px, 319.5);
  EXPECT_EQ(in.cy_px, 239.5);
  EXPECT_FALSE(in.has_distortion());
}

RC_GTEST_PROP(Intrinsics, AFieldOfViewSaidAsFloatGivesFxTo1e6, ()) {
  // OpenNI2 says the angles as floats: what a live device loses against its own recording.
  const double f = number_between(150.0, 1200.0);
  const auto horizontal = static_cast<float>(2.0 * std::atan(320.0 / f));
  const auto vertical = static_cast<float>(2.0 * std::atan(240.0 / f));
  const Intrinsics in =
      intrinsics_from_field_of_view(640, 480, static_cast<double>(horizontal), static_cast<double>(vertical));
  RC_ASSERT(std::abs(in.fx_px / f - 1.0) < 1e-6);
  RC_ASSERT(std::abs(in.fy_px / f - 1.0) < 1e-6);
}

TEST(Intrinsics, RayTableIsRowMajorAndAgreesWithEachRay) {
  Intrinsics in{5, 3, 4.0, 5.0, 2.0, 1.0, {0.05, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0}};
  const auto rays = ray_table(in);
  ASSERT_EQ(rays.size(), 15u);
  for (int v = 0; v < 3; ++v) {
    for (int u = 0; u < 5; ++u) {
      const Eigen::Vector2f expected = normalized_ray(in, u, v).cast<float>();
      EXPECT_EQ(rays[static_cast<std::size_t>(v * 5 + u)], expected);
    }
  }
}

TEST(Intrinsics, EachImpossibleFieldIsRefusedByName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](auto change) {
    Intrinsics in = vga();
    change(in);
    const auto valid = validate(in);
    return valid ? std::string("accepted") : valid.error().message;
  };
  EXPECT_TRUE(validate(vga()));
  EXPECT_EQ(refused([](auto& in) { in.width = 0; }), "image_width: got 0, takes 1 to 16384 pixels");
  EXPECT_EQ(refused([](auto& in) { in.height = -3; }), "image_height: got -3, takes 1 to 16384 pixels");
  EXPECT_EQ(refused([](auto& in) { in.fx_px = 0.0; }), "fx: got 0, takes a focal length in pixels, above 0");
  EXPECT_EQ(refused([](auto& in) { in.fx_px = -525.0; }), "fx: got -525, takes a focal length in pixels, above 0");
  EXPECT_EQ(refused([&](auto& in) { in.fy_px = nan; }), "fy: got nan, takes a focal length in pixels, above 0");
  EXPECT_EQ(refused([&](auto& in) { in.cx_px = nan; }), "cx: got nan, takes the principal point in pixels");
  EXPECT_EQ(refused([&](auto& in) { in.cy_px = INFINITY; }), "cy: got inf, takes the principal point in pixels");
  EXPECT_EQ(refused([&](auto& in) { in.distortion[4] = nan; }),
            "distortion_coefficients: got nan, takes finite numbers");
}

}  // namespace
}  // namespace tubetrack
