// What one tube hides from the look at another.
#include "hide.hpp"

#include <gtest/gtest.h>

#include <algorithm>

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
