#include <algorithm>

#include "surfel_region.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "take_heights.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using DI = hn::Rebind<std::int32_t, D>;
using D8 = hn::Rebind<std::uint8_t, D>;

/// Whether every cell has a height.
HWY_INLINE bool TakeCells(const float* height, const float* variance, const std::uint8_t* count,
                          std::int32_t* height_out, std::int32_t* variance_out) {
  const D d;
  const DI di;
  const auto half = hn::Set(d, 0.5F);
  const auto h = hn::Add(hn::Mul(hn::LoadU(d, height), hn::Set(d, 1.0F / kHeightUnit_per_m)), half);
  const auto s = hn::Add(hn::Mul(hn::LoadU(d, variance), hn::Set(d, 1.0F / kVarianceUnit_per_m2)), half);
  const auto has = hn::RebindMask(d, hn::Gt(hn::PromoteTo(di, hn::LoadU(D8(), count)), hn::Zero(di)));
  const auto usable = hn::And(has, hn::Lt(h, hn::Set(d, static_cast<float>(kHeightLimit))));
  const auto limited = hn::Min(s, hn::Set(d, static_cast<float>(kVarianceLimit)));
  hn::StoreU(hn::ConvertTo(di, hn::IfThenElseZero(usable, h)), di, height_out);
  hn::StoreU(hn::ConvertTo(di, hn::IfThenElseZero(usable, limited)), di, variance_out);
  return hn::AllTrue(d, usable);
}

/// `holes` of each column of tiles becomes 1 where a cell is without height.
void TakeRow(const float* height, const float* variance, const std::uint8_t* count, int cells, std::int32_t* height_out,
             std::int32_t* variance_out, std::uint8_t* holes) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  int i = 0;
  for (; i + lanes <= cells; i += lanes) {
    const bool all = TakeCells(height + i, variance + i, count + i, height_out + i, variance_out + i);
    holes[i / kTileWidth_px] |= all ? 0 : 1;
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
  TakeCells(last_height, last_variance, last_count, height_out + i, variance_out + i);
  if (std::find(height_out + i, height_out + cells, 0) != height_out + cells) holes[i / kTileWidth_px] = 1;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(TakeRow);

void take_heights(const HeightMap& map, const Region& region, Heights& out, std::uint8_t* holes) {
  for (int v = region.v_begin; v < region.v_end; ++v) {
    const std::size_t from = map.cell(region.u_begin, v);
    const std::size_t to = out.grid.at(region.u_begin, v);
    HWY_DYNAMIC_DISPATCH(TakeRow)
    (map.inverse_depth_per_m.data() + from, map.variance_per_m2.data() + from, map.count.data() + from,
     region.u_end - region.u_begin, out.height.data() + to, out.variance.data() + to, holes);
  }
}

}  // namespace tubetrack
#endif
