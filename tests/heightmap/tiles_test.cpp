// When the heights of a tile are taken anew.
#include "tiles.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace tubetrack {
namespace {

constexpr double kTileUnit_m = 1e-4;

/// An image of one tile at 0.8 m that has been seen for some time, and the ledger that keeps up with it.
struct TileAndLedger {
  int width;
  int height;
  HeightMap map;
  std::vector<std::uint16_t> pixels;
  SurfelWork work;
  TileLedger ledger;
  Workers alone{1};

  explicit TileAndLedger(int tile_width = 16, int tile_height = 16)
      : width(tile_width),
        height(tile_height),
        map(make_height_map({width, height, 570.0, 570.0, 8.0, 8.0, {}})),
        pixels(static_cast<std::size_t>(width * height), 8000) {
    prepare(map, 1, work);
    ledger.start(map);
    while (map.frame < 65) see();  // what is not yet old is taken again by its age, and in every 64th frame all is
  }

  std::size_t cells() const { return pixels.size(); }
  /// Was it taken?
  bool see(bool in_turns = false) {
    update(map, {pixels.data(), width, height, static_cast<std::size_t>(width) * 2, kTileUnit_m}, {}, {}, true);
    return !ledger.take_due(map, work.heights, alone, in_turns).empty();
  }
  std::int32_t height_at(std::size_t cell) const {
    return work.heights.height[work.heights.grid.at(static_cast<int>(cell) % width, static_cast<int>(cell) / width)];
  }
};

TEST(Tiles, ASettledTileWhoseCellsComeBackAtOnceIsNotTaken) {
  TileAndLedger tile;
  for (std::size_t i = 0; i < 60; ++i) {
    auto* flickers = tile.pixels.data() + 4 * (i % 32);
    std::fill_n(flickers, 4, i % 2 == 0 ? std::uint16_t{13000} : std::uint16_t{0});
    EXPECT_FALSE(tile.see()) << i;
    std::fill_n(flickers, 4, std::uint16_t{8000});
  }
}

TEST(Tiles, ASettledTileIsTakenInTheFrameInWhichASixteenthOfItsCellsIsElsewhere) {
  for (const auto& [width, height] : {std::pair{16, 16}, {13, 16}, {16, 7}, {5, 9}}) {
    TileAndLedger tile(width, height);
    std::size_t moved = 0;
    while (16 * (moved + 1) < tile.cells()) {
      tile.pixels[3 * moved] = moved % 2 == 0 ? 7000 : 0;
      ++moved;
      EXPECT_FALSE(tile.see()) << width << " x " << height << ", " << moved;
    }
    tile.pixels[3 * moved] = 7000;
    EXPECT_TRUE(tile.see()) << width << " x " << height;
    EXPECT_NEAR(tile.height_at(3 * moved) * kHeightUnit_per_m, 1.0 / 0.7, kHeightUnit_per_m);
    EXPECT_FALSE(tile.see());
  }
}

TEST(Tiles, ANewTileIsTakenWithEveryChangeForEightFrames) {
  TileAndLedger tile;
  std::fill_n(tile.pixels.begin(), 64, std::uint16_t{7000});
  EXPECT_TRUE(tile.see());
  for (std::size_t i = 1; i < 8; ++i) {
    tile.pixels[100 + i] = 7000;
    EXPECT_TRUE(tile.see()) << i;
  }
}

// At a silhouette few cells are ever steady.
TEST(Tiles, WhatComesAndGoesWithoutEverBeingSteadyIsNotTakenAgain) {
  TileAndLedger tile;
  for (int frame = 0; frame < 60; ++frame) {
    std::fill_n(tile.pixels.begin(), 40, frame % 2 == 0 ? std::uint16_t{0} : std::uint16_t{8000});
    EXPECT_EQ(tile.see(), frame == 0) << frame;  // then they had been steady
  }
}

TEST(Tiles, WhereNothingChangesAllIsTakenAgainOnceIn64FramesASixteenthAtATime) {
  TileAndLedger tiles(64, 64);
  // A drift too slow to be a change.
  std::fill(tiles.pixels.begin(), tiles.pixels.end(), std::uint16_t{8001});
  while (tiles.map.frame < 127) tiles.see();
  std::vector<std::int32_t> before;
  for (std::size_t cell = 0; cell < tiles.cells(); ++cell) before.push_back(tiles.height_at(cell));
  std::fill(tiles.pixels.begin(), tiles.pixels.end(), std::uint16_t{8003});
  std::size_t all_taken = 0;
  for (int frame = 0; frame < 64; ++frame) {
    tiles.see();
    std::size_t taken = 0;
    for (std::size_t cell = 0; cell < tiles.cells(); ++cell) {
      if (tiles.height_at(cell) == before[cell]) continue;
      ++taken;
      before[cell] = tiles.height_at(cell);
    }
    EXPECT_EQ(taken, frame % 4 == 0 ? tiles.cells() / 16 : 0U) << frame;
    all_taken += taken;
  }
  EXPECT_EQ(all_taken, tiles.cells());
}

TEST(Tiles, InTurnsEachHalfOfWhatChangesIsTakenInEverySecondCall) {
  TileAndLedger tiles(32, 64);
  const std::size_t half = tiles.cells() / 2;
  const auto level = [](int frame) { return static_cast<std::uint16_t>(8000 - 300 * frame); };
  for (int frame = 1; frame <= 6; ++frame) {
    std::fill(tiles.pixels.begin(), tiles.pixels.end(), level(frame));
    ASSERT_TRUE(tiles.see(true));
    int upper_age = -1, lower_age = -1;
    for (int age = 0; age < 2; ++age) {
      const double height = 1.0 / (kTileUnit_m * level(frame - age)) / kHeightUnit_per_m;
      if (std::abs(tiles.height_at(0) - height) < 1.0) upper_age = age;
      if (std::abs(tiles.height_at(half) - height) < 1.0) lower_age = age;
    }
    EXPECT_EQ(upper_age, (frame + 1) % 2) << frame;
    EXPECT_EQ(lower_age, frame % 2) << frame;
  }
}

TEST(Tiles, InTurnsARowOfTilesIsHalvedToo) {
  TileAndLedger tiles(64, 16);
  for (int frame = 1; frame <= 4; ++frame) {
    std::vector<std::int32_t> before;
    for (int column = 0; column < 4; ++column) before.push_back(tiles.height_at(static_cast<std::size_t>(16 * column)));
    std::fill(tiles.pixels.begin(), tiles.pixels.end(), static_cast<std::uint16_t>(8000 - 300 * frame));
    ASSERT_TRUE(tiles.see(true));
    for (int column = 0; column < 4; ++column) {
      const bool taken =
          tiles.height_at(static_cast<std::size_t>(16 * column)) != before[static_cast<std::size_t>(column)];
      EXPECT_EQ(taken, (column < 2) == (frame % 2 == 1)) << frame << ' ' << column;
    }
  }
}

TEST(Tiles, WhatWasPutOffIsTakenInTheNextCallThoughNothingChangesAnyMore) {
  TileAndLedger tiles(32, 64);
  std::fill(tiles.pixels.begin(), tiles.pixels.end(), std::uint16_t{7000});
  ASSERT_TRUE(tiles.see(true));
  ASSERT_TRUE(tiles.see(true));
  for (std::size_t cell = 0; cell < tiles.cells(); cell += 16) {
    EXPECT_NEAR(tiles.height_at(cell) * kHeightUnit_per_m, 1.0 / 0.7, kHeightUnit_per_m) << cell;
  }
}

}  // namespace
}  // namespace tubetrack
