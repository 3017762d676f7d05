#include "tubetrack/heightmap/height_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "tubetrack/sensors/disparity_levels.hpp"

namespace tubetrack {
namespace {

const Intrinsics kTinyCamera{16, 12, 20.0, 20.0, 7.5, 5.5, {}};
constexpr double kUnit = 0.0001;  // metres

/// A camera that sees the same reading in every pixel.
struct Even {
  HeightMap map = make_height_map(kTinyCamera);
  NoiseModel noise;
  HeightMapLimits limits;

  void see(double depth_m, bool fuse = true) {
    const std::vector<std::uint16_t> pixels(16 * 12, static_cast<std::uint16_t>(std::lround(depth_m / kUnit)));
    const DepthFrame frame{pixels.data(), 16, 12, 32, kUnit};
    update(map, frame, noise, limits, fuse);
  }
  double depth() const { return 1.0 / map.inverse_depth_per_m[40]; }
  double sigma() const { return std::sqrt(map.variance_per_m2[40]); }  ///< of the inverse depth
  int count() const { return map.count[40]; }
  /// The depth whose inverse is `sigmas` of a new reading and the cell together away.
  double away(double sigmas) const {
    const double w = map.inverse_depth_per_m[40];
    const double reading = axial_sigma_m(noise, 1.0 / w, 0.0) * w * w;
    return 1.0 / (w + sigmas * std::hypot(reading, sigma()));
  }
};

/// A frame of random depths, rounded to disparity levels or not, in millimetres.
std::vector<std::uint16_t> random_depths(bool at_levels, const NoiseModel& noise, double from_m = 0.8,
                                         double to_m = 2.0) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> depth(from_m, to_m);
  std::vector<std::uint16_t> pixels(640 * 480);
  for (std::uint16_t& pixel : pixels) {
    const double z = depth(random);
    pixel = static_cast<std::uint16_t>(
        std::lround(1000.0 * (at_levels ? depth_of_level_m(disparity_levels(noise, 0.001), z) : z)));
  }
  return pixels;
}

TEST(DisparityLevels, ShowInAFrameThatHasThemAndInNoOther) {
  const NoiseModel noise;
  const auto levels = random_depths(true, noise);
  const auto others = random_depths(false, noise);
  EXPECT_EQ(lies_at_disparity_levels({levels.data(), 640, 480, 1280, 0.001}, noise), true);
  EXPECT_EQ(lies_at_disparity_levels({others.data(), 640, 480, 1280, 0.001}, noise), false);
  NoiseModel without;
  without.disparity_step_px = 0.0;
  EXPECT_EQ(lies_at_disparity_levels({levels.data(), 640, 480, 1280, 0.001}, without), false);
  EXPECT_EQ(lies_at_disparity_levels({levels.data(), 100, 10, 200, 0.001}, noise), std::nullopt) << "too few to tell";
}

TEST(DisparityLevels, ShowInAFrameOfNearThings) {
  const NoiseModel noise;
  const auto levels = random_depths(true, noise, 0.35, 0.70);
  const auto others = random_depths(false, noise, 0.35, 0.70);
  EXPECT_EQ(lies_at_disparity_levels({levels.data(), 640, 480, 1280, 0.001}, noise), true);
  EXPECT_EQ(lies_at_disparity_levels({others.data(), 640, 480, 1280, 0.001}, noise), false);
  const auto nearer = random_depths(true, noise, 0.35, 0.58);
  EXPECT_EQ(lies_at_disparity_levels({nearer.data(), 640, 480, 1280, 0.001}, noise), std::nullopt)
      << "every millimetre has a level there";
}

TEST(HeightMap, AFirstReadingIsTakenWithTheSensorsNoise) {
  Even view;
  view.see(0.8);
  EXPECT_EQ(view.count(), 1);
  EXPECT_NEAR(view.depth(), 0.8, 1e-6);
  EXPECT_NEAR(view.sigma(), axial_sigma_m(view.noise, 0.8, 0.0) / 0.64, 1e-5);
}

TEST(HeightMap, AgreeingReadingsAverageAndTheirVarianceFalls) {
  Even view;
  view.see(0.8);
  const double one = view.sigma();
  view.see(0.802);
  view.see(0.801);
  EXPECT_EQ(view.count(), 3);
  EXPECT_NEAR(1.0 / view.depth(), (1.0 / 0.8 + 1.0 / 0.802 + 1.0 / 0.801) / 3.0, 1e-6);
  EXPECT_NEAR(view.sigma(), one / std::sqrt(3.0), 0.01 * one);
}

TEST(HeightMap, After30FramesTheOldestFadesOut) {
  Even view;
  for (int i = 0; i < 100; ++i) view.see(0.8);
  EXPECT_EQ(view.count(), 30);
  view.see(0.803);
  EXPECT_EQ(view.count(), 30);
  EXPECT_NEAR(1.0 / view.depth(), 1.0 / 0.8 + (1.0 / 0.803 - 1.0 / 0.8) / 30.0, 1e-6);
}

TEST(HeightMap, JustWithin3SigmaRefines) {
  Even view;
  view.see(0.8);
  view.see(view.away(2.9));
  EXPECT_EQ(view.count(), 2);
}

TEST(HeightMap, Beyond3SigmaOnceIsLeftOut) {
  Even view;
  view.see(0.8);
  view.see(view.away(3.1));
  EXPECT_EQ(view.count(), 1);
  EXPECT_NEAR(view.depth(), 0.8, 1e-6);
  view.see(0.8);  // agrees again: the strike is forgotten
  EXPECT_EQ(view.count(), 2);
  view.see(view.away(3.2));
  EXPECT_EQ(view.count(), 2);
  EXPECT_NEAR(view.depth(), 0.8, 1e-6);
}

TEST(HeightMap, Beyond3SigmaTwiceRunningRestarts) {
  Even view;
  for (int i = 0; i < 5; ++i) view.see(0.8);
  const double moved = view.away(-4.0);
  view.see(moved);
  EXPECT_EQ(view.count(), 5);
  view.see(moved);
  EXPECT_EQ(view.count(), 1);
  EXPECT_NEAR(view.depth(), moved, kUnit);
  view.see(moved);
  EXPECT_EQ(view.count(), 2);
}

TEST(HeightMap, Beyond5SigmaRestartsAtOnce) {
  Even view;
  for (int i = 0; i < 5; ++i) view.see(0.8);
  view.see(view.away(4.9));
  EXPECT_EQ(view.count(), 5);
  Even jump;
  for (int i = 0; i < 5; ++i) jump.see(0.8);
  const double moved = jump.away(5.1);
  jump.see(moved);
  EXPECT_EQ(jump.count(), 1);
  EXPECT_NEAR(jump.depth(), moved, kUnit);
}

TEST(HeightMap, WithAMovingCameraEveryReadingRestarts) {
  Even view;
  for (int i = 0; i < 4; ++i) view.see(0.8 + 0.0001 * i, false);
  EXPECT_EQ(view.count(), 1);
  EXPECT_NEAR(view.depth(), 0.8003, 1e-6);
}

TEST(HeightMap, ACellWithoutReturnIsEmptyAndStartsAnew) {
  Even view;
  for (int i = 0; i < 5; ++i) view.see(0.8);
  view.see(0.0);
  EXPECT_EQ(view.count(), 0);
  EXPECT_EQ(view.map.depth_m[40], 0.0F);
  EXPECT_EQ(view.map.inverse_depth_per_m[40], 0.0F);
  view.see(0.9);
  EXPECT_EQ(view.count(), 1);
  EXPECT_NEAR(view.depth(), 0.9, 1e-6);
}

TEST(HeightMap, ReadingsOutOfTheDepthRangeAreNone) {
  Even view;
  view.limits.depth_min_m = 0.5;
  view.limits.depth_max_m = 1.5;
  for (const auto& [depth_m, taken] : {std::pair{0.4999, 0}, {0.5001, 1}, {1.4999, 1}, {1.5001, 0}}) {
    view.see(depth_m, false);
    EXPECT_EQ(view.count(), taken) << depth_m;
  }
}

TEST(HeightMap, OnlyTheRegionOfInterestIsTaken) {
  Even view;
  view.limits.roi_u_px = 3;
  view.limits.roi_v_px = 2;
  view.limits.roi_width_px = 5;
  view.limits.roi_height_px = 40;  // beyond the image
  view.see(0.8);
  for (int v = 0; v < 12; ++v) {
    for (int u = 0; u < 16; ++u) {
      EXPECT_EQ(view.map.count[view.map.cell(u, v)], u >= 3 && u < 8 && v >= 2 ? 1 : 0) << u << ' ' << v;
    }
  }
}

TEST(HeightMap, ThePointOfACellIsOnItsPixelsRay) {
  HeightMap map = make_height_map(kTinyCamera);
  // Rows of 20 pixels of which 16 are the image.
  std::vector<std::uint16_t> pixels(20 * 12, 0);
  for (int v = 0; v < 12; ++v) {
    for (int u = 0; u < 16; ++u)
      pixels[static_cast<std::size_t>(20 * v + u)] = static_cast<std::uint16_t>(8000 + 16 * v + u);
  }
  update(map, {pixels.data(), 16, 12, 40, kUnit}, {}, {}, true);
  for (int v = 0; v < 12; ++v) {
    for (int u = 0; u < 16; ++u) {
      const Eigen::Vector3d point = map.point(map.cell(u, v));
      EXPECT_NEAR(point.z(), kUnit * (8000 + 16 * v + u), 1e-6);
      EXPECT_LT((project(kTinyCamera, point) - Eigen::Vector2d(u, v)).norm(), 1e-4);
    }
  }
}

/// One tile of 192 cells at 0.8 m, of which some read otherwise.
struct OneTile {
  HeightMap map = make_height_map(kTinyCamera);
  std::vector<std::uint16_t> pixels = std::vector<std::uint16_t>(16 * 12, 8000);

  void see(int frames = 1) {
    for (int i = 0; i < frames; ++i) update(map, {pixels.data(), 16, 12, 32, kUnit}, {}, {}, true);
  }
  bool changed() const { return map.tile_changed_in[0] == map.frame; }
};

TEST(HeightMap, ATileIsNewWhenAQuarterOfItsCellsChangeAtOnce) {
  for (const int cells : {47, 48}) {
    OneTile tile;
    tile.see();
    EXPECT_TRUE(tile.changed());
    tile.see();
    EXPECT_FALSE(tile.changed());
    std::fill_n(tile.pixels.begin(), cells, std::uint16_t{7000});
    tile.see();
    EXPECT_TRUE(tile.changed());
    EXPECT_EQ(tile.map.tile_new_in[0], cells == 48 ? 3U : 1U);
  }
}

TEST(HeightMap, ATileChangesWhenOneAfterTheOtherASixteenthOfItsCellsHaveThatWereSteady) {
  OneTile tile;
  tile.see(10);
  for (std::size_t i = 0; i < 24; ++i) {
    tile.pixels[8 * i] = i % 2 == 0 ? std::uint16_t{7000} : std::uint16_t{0};
    tile.see();
    EXPECT_EQ(tile.changed(), i == 11 || i == 23) << i;
  }
}

TEST(HeightMap, ATileThatIsNotNewDoesNotChangeWhereReadingsOnlyComeAndGo) {
  OneTile tile;
  for (int frame = 0; frame < 60; ++frame) {
    std::fill_n(tile.pixels.begin(), 20, frame % 2 == 0 ? std::uint16_t{0} : std::uint16_t{8000});
    tile.see();
    EXPECT_EQ(tile.changed(), frame < 8) << frame;
  }
}

/// A cell by the rules, in doubles.
struct Cell {
  double w = 0.0, variance = 0.0;
  int count = 0, strikes = 0;

  void take(double depth_m, const NoiseModel& noise) {
    if (depth_m == 0.0) {
      count = 0;
      return;
    }
    const double reading = 1.0 / depth_m;
    const double sigma = axial_sigma_m(noise, depth_m, 0.0) * reading * reading;
    const double off = count > 0 ? std::abs(reading - w) / std::sqrt(sigma * sigma + variance) : 0.0;
    const bool strike = off > 3.0 && off <= 5.0;
    const bool restart = count == 0 || off > 5.0 || (strike && ++strikes >= 2);
    if (strike && !restart) return;
    strikes = 0;
    count = restart ? 1 : std::min(count + 1, 30);
    w += (reading - w) / count;
    variance = sigma * sigma / count;
  }
};

TEST(HeightMap, OverRandomReadingsEveryCellFollowsTheRules) {
  HeightMap map = make_height_map(kTinyCamera);
  const NoiseModel noise;
  std::vector<Cell> cells(map.rays.size());
  std::mt19937_64 random(8);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<std::uint16_t> pixels(cells.size(), 8000);
  int unsure = 0;
  for (int frame = 0; frame < 200; ++frame) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const double kind = unit(random);
      const double spread = kind < 0.8 ? 0.0015 : kind < 0.95 ? 0.008 : 0.05;
      const bool none = kind > 0.99;
      pixels[i] = none ? 0 : static_cast<std::uint16_t>(std::lround((0.8 + spread * gauss(random)) / kUnit));
      cells[i].take(pixels[i] * kUnit, noise);
    }
    update(map, {pixels.data(), 16, 12, 32, kUnit}, noise, {}, true);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (map.count[i] != cells[i].count) {  // a reading on a limit, to the map's floats: take its word
        ++unsure;
        cells[i] = {map.inverse_depth_per_m[i], map.variance_per_m2[i], map.count[i], map.strikes[i]};
      }
      if (cells[i].count == 0) continue;
      EXPECT_NEAR(map.inverse_depth_per_m[i], cells[i].w, 1e-5);
      EXPECT_NEAR(map.variance_per_m2[i], cells[i].variance, 5e-3 * cells[i].variance);  // σ is looked up by the mm
    }
  }
  EXPECT_LT(unsure, 200 * 192 / 500);
}

}  // namespace
}  // namespace tubetrack
