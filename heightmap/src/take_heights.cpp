#include <algorithm>
#include <bit>

#include "fuse_row.hpp"
#include "surfel_region.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "take_heights.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

#include "lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

using D8 = hn::Rebind<std::uint8_t, D>;

/// A bit for each of a vector's cells that has a steady height.
HWY_INLINE std::uint64_t TakeCells(const float* height, const float* variance, const std::uint8_t* count,
                                   std::int32_t* height_out, std::int32_t* variance_out) {
  const D d;
  const DI di;
  const auto half = hn::Set(d, 0.5F);
  const auto h = hn::Add(hn::Mul(hn::LoadU(d, height), hn::Set(d, 1.0F / kHeightUnit_per_m)), half);
  const auto s = hn::Add(hn::Mul(hn::LoadU(d, variance), hn::Set(d, 1.0F / kVarianceUnit_per_m2)), half);
  const auto frames = hn::PromoteTo(di, hn::LoadU(D8(), count));
  const auto has = hn::RebindMask(d, hn::Gt(frames, hn::Zero(di)));
  const auto steady = hn::RebindMask(d, hn::Gt(frames, hn::Set(di, kSteadyCount - 1)));
  const auto usable = hn::And(has, hn::Lt(h, hn::Set(d, static_cast<float>(kHeightLimit))));
  const auto limited = hn::Min(s, hn::Set(d, static_cast<float>(kVarianceLimit)));
  hn::StoreU(hn::ConvertTo(di, hn::IfThenElseZero(usable, h)), di, height_out);
  hn::StoreU(hn::ConvertTo(di, hn::IfThenElseZero(usable, limited)), di, variance_out);
  return Bits(hn::And(usable, steady));
}

/// `steady` has a bit for each cell, in one number for every column of tiles.
void TakeRow(const float* height, const float* variance, const std::uint8_t* count, int cells, std::int32_t* height_out,
             std::int32_t* variance_out, std::uint16_t* steady) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  std::fill_n(steady, (cells + kTileWidth_px - 1) / kTileWidth_px, std::uint16_t{0});
  const auto note = [&](int i, std::uint64_t bits) {
    steady[i / kTileWidth_px] |= static_cast<std::uint16_t>(bits << i % kTileWidth_px);
  };
  int i = 0;
  for (; i + lanes <= cells; i += lanes) {
    note(i, TakeCells(height + i, variance + i, count + i, height_out + i, variance_out + i));
  }
  const int left = std::min(cells - i, 16);
  if (left <= 0) return;
  float last_height[16] = {};
  float last_variance[16] = {};
  std::uint8_t last_count[16] = {};
  std::copy_n(height + i, left, last_height);
  std::copy_n(variance + i, left, last_variance);
  std::copy_n(count + i, left, last_count);
  // What is written beyond the last cell is zero, in the margin.
  note(i, TakeCells(last_height, last_variance, last_count, height_out + i, variance_out + i));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(TakeRow);

void take_heights(const HeightMap& map, const Region& region, Heights& out) {
  for (int v = region.v_begin; v < region.v_end; ++v) {
    const std::size_t from = map.cell(region.u_begin, v);
    const std::size_t to = out.grid.at(region.u_begin, v);
    HWY_DYNAMIC_DISPATCH(TakeRow)
    (map.inverse_depth_per_m.data() + from, map.variance_per_m2.data() + from, map.count.data() + from,
     region.u_end - region.u_begin, out.height.data() + to, out.variance.data() + to,
     out.steady.data() + out.grid.tile(region.u_begin, v));
  }
}

int count_moved(const HeightMap& map, const Region& region, const Heights& taken) {
  constexpr float kSigmas2 = 25.0F;  // as for a cell to restart
  int moved = 0;
  for (int v = region.v_begin; v < region.v_end; ++v) {
    const std::size_t first = taken.grid.at(region.u_begin, v);
    const std::size_t now = map.cell(region.u_begin, v);
    for (unsigned bits = taken.steady[taken.grid.tile(region.u_begin, v)]; bits != 0; bits &= bits - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(bits));
      const float off =
          map.inverse_depth_per_m[now + i] - kHeightUnit_per_m * static_cast<float>(taken.height[first + i]);
      const float variance =
          map.variance_per_m2[now + i] + kVarianceUnit_per_m2 * static_cast<float>(taken.variance[first + i]);
      moved += map.count[now + i] == 0 || off * off > kSigmas2 * variance ? 1 : 0;
    }
  }
  return moved;
}

}  // namespace tubetrack
#endif
