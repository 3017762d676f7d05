// What one tube hides from the look at another.
#include "hide.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tube_scene.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {
namespace {

struct Looked {
  HeightMap map;
  TubeModel model;
  PredictedPixels pixels;
  Extent extent;
};

Looked look_at_a_tube() {
  const Eigen::Vector3d middle(0.02, -0.01, 0.8);
  const Eigen::Vector3d axis = Eigen::Vector3d(1.0, 0.3, 0.1).normalized();
  Looked looked;
  looked.map = cylinder_map({640, 480, 580.0, 580.0, 319.5, 239.5}, middle, axis, 0.15, 0.02);
  looked.model = straight_model(middle, axis, 0.15, 0.02);
  looked.pixels = predict_pixels(looked.map, {}, looked.model);
  looked.extent = {0.0, looked.model.spline.spans()};
  return looked;
}

std::ptrdiff_t hidden_cells(const HeightMap& map) {
  return std::count_if(map.depth_m.begin(), map.depth_m.end(), [](float depth_m) { return depth_m < 0.0F; });
}

TEST(Hide, AllReadingsThatAgreeWithTheOtherAreTakenOutAndComeBackBitForBit) {
  Looked looked = look_at_a_tube();
  const std::vector<float> before = looked.map.depth_m;
  HiddenCells hidden;
  const SeenTube other{looked.model, looked.extent, looked.pixels};
  hide_from(nullptr, other, looked.map, hidden);
  hide_from(nullptr, other, looked.map, hidden);  // twice takes nothing more
  EXPECT_GT(hidden_cells(looked.map), 1000);
  EXPECT_EQ(static_cast<std::size_t>(hidden_cells(looked.map)), hidden.size());
  for (const PredictedPixel& pixel : looked.pixels) EXPECT_LE(looked.map.depth_m[pixel.cell], 0.0F);
  show_again(looked.map, hidden);
  EXPECT_EQ(looked.map.depth_m, before);
  EXPECT_TRUE(hidden.empty());
}

// At its edge most readings are missing or lie between two depths, and what is beside it is mixed all the same.
TEST(Hide, ThePixelsAroundTheOthersOutlineGoWhateverIsReadOnIt) {
  Looked looked = look_at_a_tube();
  Looked edgeless = look_at_a_tube();
  for (float& depth_m : looked.map.depth_m) depth_m = depth_m > 0.0F ? depth_m : 0.82F;
  edgeless.map.depth_m = looked.map.depth_m;
  for (const PredictedPixel& pixel : edgeless.pixels) {
    if (pixel.margin_px < 1.0F) edgeless.map.depth_m[pixel.cell] = pixel.cell % 2 == 0 ? 0.0F : 0.815F;
  }
  HiddenCells hidden;
  hide_from(nullptr, {looked.model, looked.extent, looked.pixels}, looked.map, hidden);
  hide_from(nullptr, {edgeless.model, edgeless.extent, edgeless.pixels}, edgeless.map, hidden);
  for (std::size_t cell = 0; cell < looked.map.depth_m.size(); ++cell) {
    if (looked.map.depth_m[cell] >= 0.0F) continue;
    EXPECT_LE(edgeless.map.depth_m[cell], 0.0F) << "cell " << cell;
  }
}

TEST(Hide, ReadingsBesideAPixelOfTheTubeWithoutReturnAreTakenOutAndComeBack) {
  Looked looked = look_at_a_tube();
  const std::size_t gap = looked.map.cell(334, 233);  // on the axis
  looked.map.depth_m[gap] = 0.0F;
  const std::vector<float> before = looked.map.depth_m;
  HiddenCells hidden;
  hide_beside_gaps({looked.model, looked.extent, looked.pixels}, looked.map, hidden);
  EXPECT_EQ(hidden.size(), 8U);
  for (const std::uint32_t cell : hidden) {
    EXPECT_LE(std::abs(static_cast<int>(cell % 640) - 334), 1);
    EXPECT_LE(std::abs(static_cast<int>(cell / 640) - 233), 1);
  }
  show_again(looked.map, hidden);
  EXPECT_EQ(looked.map.depth_m, before);
}

// There readings are missing for the silhouette's sake, and those beside it are not fitted anyway.
TEST(Hide, PixelsWithoutReturnAtTheSilhouetteOrBeyondTheExtentTakeNothingOut) {
  Looked looked = look_at_a_tube();
  for (const PredictedPixel& pixel : looked.pixels) {
    if (pixel.margin_px < 1.5F || pixel.t < 2.0F) looked.map.depth_m[pixel.cell] = 0.0F;
  }
  HiddenCells hidden;
  const Extent extent{2.0, looked.extent.t_end};
  hide_beside_gaps({looked.model, extent, looked.pixels}, looked.map, hidden);
  EXPECT_TRUE(hidden.empty());
}

TEST(Hide, WhatHidesTheOtherStays) {
  Looked looked = look_at_a_tube();
  std::ranges::fill(looked.map.depth_m, 0.5F);
  HiddenCells hidden;
  hide_from(nullptr, {looked.model, looked.extent, looked.pixels}, looked.map, hidden);
  EXPECT_TRUE(hidden.empty());
}

TEST(Hide, WhatIsSeenInFrontOfTheOtherStays) {
  Looked looked = look_at_a_tube();
  TubeModel nearer = looked.model;
  for (Eigen::Vector3d& control : nearer.spline.control_m) control.z() -= 0.001;
  const auto pixels = predict_pixels(looked.map, {}, nearer);
  HiddenCells hidden;
  const SeenTube mine{nearer, looked.extent, pixels};
  hide_from(&mine, {looked.model, looked.extent, looked.pixels}, looked.map, hidden);
  // Left are pixels along the outline, which one of the two just misses.
  EXPECT_LT(10 * hidden.size(), looked.pixels.size());
}

TEST(Hide, ATubeTakesNothingBeyondTheExtentThatItIsSeenAlong) {
  Looked looked = look_at_a_tube();
  HiddenCells all, half;
  hide_from(nullptr, {looked.model, looked.extent, looked.pixels}, looked.map, all);
  const std::size_t count = all.size();
  show_again(looked.map, all);
  const Extent first_half{0.0, 0.5 * looked.extent.t_end};
  hide_from(nullptr, {looked.model, first_half, looked.pixels}, looked.map, half);
  EXPECT_NEAR(static_cast<double>(half.size()), 0.5 * static_cast<double>(count), 0.06 * static_cast<double>(count));
}

}  // namespace
}  // namespace tubetrack
