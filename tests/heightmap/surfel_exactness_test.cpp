// The surfels are the same whatever the vector length and whatever was kept from the frame before, take any image, and
// cost no allocation once the first frame is through.
#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <array>
#include <cstring>
#include <vector>

#include "allocations.hpp"
#include "heightmap/slow_surfels.hpp"
#include "heightmap/surfel_stream.hpp"
#include "surfel_region.hpp"
#include "tiles.hpp"

namespace tubetrack {
namespace {

/// A frame of the stream that stays as it is but for random patches, which jump, lose their readings or come back.
struct Patches {
  Stream stream;
  std::vector<std::uint16_t> base;
  std::mt19937_64 random{5};

  Patches() {
    stream.hole_share = 0.02;
    stream.next();
    base = stream.pixels;
  }
  DepthFrame next() {
    const auto up_to = [&](int n) { return std::uniform_int_distribution<int>(0, n)(random); };
    for (int patch = up_to(2); patch > 0; --patch) {
      const int u = up_to(310), v = up_to(230), w = up_to(30), h = up_to(20), kind = up_to(2);
      for (int row = v; row < std::min(240, v + h + 1); ++row) {
        for (int col = u; col < std::min(320, u + w + 1); ++col) {
          const auto at = static_cast<std::size_t>(row * 320 + col);
          stream.pixels[at] = kind == 0   ? std::uint16_t{0}
                              : kind == 1 ? base[at]
                                          : static_cast<std::uint16_t>(base[at] * 0.8);
        }
      }
    }
    return {stream.pixels.data(), 320, 240, 640, 1e-4};
  }
};

bool same_found(const SurfelWork& a, const SurfelWork& b) {
  if (a.found_count != b.found_count) return false;
  for (std::size_t v = 0; v < a.found_count.size(); ++v) {
    const std::size_t row = v * static_cast<std::size_t>(a.heights.grid.width);
    const auto bytes = static_cast<std::size_t>(a.found_count[v]) * sizeof(FoundSurfel);
    if (std::memcmp(a.found.get() + row, b.found.get() + row, bytes) != 0) return false;
  }
  return true;
}

TEST(SurfelFinder, IncrementallyFindsBitForBitWhatItFindsAnewInTheSameHeights) {
  Patches patches;
  HeightMap map = make_height_map(kStreamCamera);
  const EdgeRule edge_rule({}, kStreamCamera.fx_px);
  SurfelWork work;
  TileLedger ledger;
  prepare(map, 1, work);
  ledger.start(map);
  const SurfelRule rule(kStreamCamera, work.longest_ray2, {}, {});
  Workers alone(1);
  int partial = 0;
  for (int frame = 0; frame < 150; ++frame) {
    update(map, patches.next(), {}, {}, true);
    const bool in_turns = frame / 10 % 2 == 1;
    const auto regions = ledger.take_due(map, work.heights, alone, in_turns);
    find_in_regions(rule, edge_rule, regions, ledger.affected(), {0, 240}, work, alone);
    int cells = 0;
    for (const Region& region : regions) cells += (region.u_end - region.u_begin) * (region.v_end - region.v_begin);
    partial += cells < 320 * 240 ? 1 : 0;
    SurfelWork anew;
    prepare(map, 1, anew);
    anew.heights = work.heights;
    const Region all{0, 320, 0, 240};
    find_in_regions(rule, edge_rule, {&all, 1}, {}, {0, 240}, anew, alone);
    ASSERT_TRUE(same_found(work, anew)) << "frame " << frame;
  }
  EXPECT_GT(partial, 100);
}

// What bends too little for the largest radius is left out before its curvature is computed.
TEST(SurfelFinder, LosesNothingToTheScreenOnBends) {
  Stream stream;
  stream.hole_share = 0.01;
  HeightMap map = make_height_map(kStreamCamera);
  const Region all{0, 320, 0, 240};
  Workers alone(1);
  for (const double radius_max_m : {0.04, 0.1}) {
    SurfelOptions options;
    options.radius_max_m = radius_max_m;
    for (int frame = 0; frame < 8; ++frame) {
      update(map, stream.next(), {}, {}, frame % 2 == 0);
      SurfelWork screened;
      prepare(map, 1, screened);
      take_heights(map, all, screened.heights);
      SurfelWork full;
      prepare(map, 1, full);
      full.heights = screened.heights;
      SurfelRule rule(kStreamCamera, screened.longest_ray2, {}, options);
      find_in_regions(rule, EdgeRule({}, kStreamCamera.fx_px), {&all, 1}, {}, {0, 240}, screened, alone);
      ASSERT_GT(rule.screen_bend_per_m, 0.0F);
      rule.screen_bend_per_m = 0.0F;
      find_in_regions(rule, EdgeRule({}, kStreamCamera.fx_px), {&all, 1}, {}, {0, 240}, full, alone);
      ASSERT_TRUE(same_found(screened, full)) << radius_max_m << ' ' << frame;
    }
  }
}

TEST(SurfelFinder, FindsTheSameBytesWithEveryVectorLength) {
  std::vector<Surfel> first_surfels;
  std::vector<float> first_heights;
  std::vector<std::int64_t> targets{0};  // whatever is best
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) targets.push_back(target);
  for (const std::int64_t target : targets) {
    hwy::SetSupportedTargetsForTest(target);
    Stream stream;
    stream.camera.width = 309;  // not a multiple of any vector
    stream.hole_share = 0.05;
    HeightMap map = make_height_map(stream.camera);
    SurfelFinder finder;
    std::vector<Surfel> all;
    for (int frame = 0; frame < 4; ++frame) {
      update(map, stream.next(), {}, {}, true);
      const auto found = finder.find(map, {}, {});
      all.insert(all.end(), found.begin(), found.end());
    }
    if (target == 0) {
      first_surfels = all;
      first_heights = map.inverse_depth_per_m;
    }
    EXPECT_EQ(map.inverse_depth_per_m, first_heights) << target;
    ASSERT_EQ(all.size(), first_surfels.size()) << target;
    EXPECT_EQ(std::memcmp(all.data(), first_surfels.data(), all.size() * sizeof(Surfel)), 0) << target;
  }
  hwy::SetSupportedTargetsForTest(0);
  EXPECT_GT(first_surfels.size(), 1000U);
}

TEST(SurfelFinder, AllocatesNothingAfterTheFirstFrame) {
  Patches patches;
  HeightMap map = make_height_map(kStreamCamera);
  SurfelFinder finder;
  const NoiseModel noise;
  update(map, patches.next(), noise, {}, true);
  ASSERT_GT(finder.find(map, noise, {}).size(), 1000U);
  const std::size_t before = allocations_so_far();
  for (int frame = 0; frame < 40; ++frame) {
    update(map, patches.next(), noise, {}, frame % 4 != 0);
    finder.find(map, noise, {});
  }
  EXPECT_EQ(allocations_so_far(), before);
}

TEST(SurfelFinder, LeavesOutTheCellsToSkip) {
  Stream stream;
  HeightMap map = make_height_map(kStreamCamera);
  update(map, stream.next(), {}, {}, true);
  SurfelFinder finder;
  std::vector<std::uint8_t> skip(map.rays.size(), 0);
  std::vector<Surfel> wanted;
  for (const Surfel& surfel : finder.find(map, {}, {})) {
    if (surfel.cell % 3 != 0) wanted.push_back(surfel);
  }
  for (std::size_t cell = 0; cell < skip.size(); cell += 3) skip[cell] = 1;
  const auto found = finder.find(map, {}, {}, skip);
  ASSERT_EQ(found.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_EQ(found[i].cell, wanted[i].cell);
}

TEST(SurfelFinder, InSomeRowsFindsBitForBitWhatItFindsThereInAll) {
  Stream stream;
  stream.hole_share = 0.02;
  HeightMap map = make_height_map(kStreamCamera);
  SurfelOptions options;
  options.narrowest_strip_px = 8.0;
  options.widest_strip_px = 16.0;
  SurfelFinder in_rows;
  Workers three(3);
  const std::array<Part, 7> turns{{{0, 120}, {120, 240}, {60, 180}, {60, 180}, {7, 8}, {61, 179}, {200, 1000}}};
  for (std::size_t frame = 0; frame < 2 * turns.size(); ++frame) {
    // Near enough for narrow strips, and so that what an earlier frame left beside the rows is of other places.
    stream.shift_m.y() = 0.01 * static_cast<double>(frame);
    update(map, stream.next(), {}, {}, frame % 3 == 2);
    const Part& rows = turns[frame % turns.size()];
    SurfelOptions some = options;
    some.v_begin = rows.begin;
    some.v_end = rows.end;
    const auto found = in_rows.find(map, {}, some, {}, three);
    std::vector<Surfel> wanted;
    SurfelFinder fresh;
    for (const Surfel& surfel : fresh.find(map, {}, options)) {
      const auto v = static_cast<int>(surfel.cell) / 320;
      if (v >= rows.begin && v < rows.end) wanted.push_back(surfel);
    }
    ASSERT_EQ(found.size(), wanted.size()) << "frame " << frame;
    EXPECT_GT(wanted.size(), rows.end - rows.begin > 1 ? 100U : 0U);
    EXPECT_EQ(std::memcmp(found.data(), wanted.data(), wanted.size() * sizeof(Surfel)), 0) << "frame " << frame;
  }
}

TEST(SurfelFinder, TakesImagesOfAnySize) {
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {1, 100}, {100, 1}, {33, 47}, {65, 40}, {130, 21}}) {
    const Intrinsics camera{width, height, 60.0, 60.0, 0.5 * (width - 1), 0.5 * (height - 1), {}};
    for (const bool empty : {false, true}) {
      Stream stream;
      stream.camera = camera;
      stream.hole_share = empty ? 1.0 : 0.1;
      stream.noise_scale = 0.1;
      HeightMap map = make_height_map(camera);
      SurfelFinder finder;
      for (int frame = 0; frame < 3; ++frame) {
        update(map, stream.next(), {}, {}, false);
        const auto fast = finder.find(map, {}, {});
        const auto slow = slow_tube_surfels(map, {}, {});
        EXPECT_LE(compare(fast, slow).one_only, 2 + slow.size() / 50) << width << " x " << height;
        EXPECT_TRUE(!empty || fast.empty());
      }
    }
  }
}

TEST(SurfelFinder, ARegionOfInterestEndsLikeTheImage) {
  Stream stream;
  HeightMap map = make_height_map(kStreamCamera);
  HeightMapLimits limits;
  limits.roi_u_px = 45;
  limits.roi_v_px = 31;
  limits.roi_width_px = 203;
  limits.roi_height_px = 150;
  SurfelFinder finder;
  update(map, stream.next(), {}, {}, false);
  finder.find(map, {}, {});
  update(map, stream.next(), {}, limits, false);
  const auto slow = slow_tube_surfels(map, {}, {});
  EXPECT_GT(slow.size(), 500U);
  EXPECT_LE(compare(finder.find(map, {}, {}), slow).one_only, slow.size() / 50);
}

}  // namespace
}  // namespace tubetrack
