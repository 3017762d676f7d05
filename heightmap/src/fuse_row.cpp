#include "fuse_row.hpp"

#include <algorithm>
#include <bit>

#include "tubetrack/heightmap/height_map.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fuse_row.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

#include "lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

using D16 = hn::Rebind<std::uint16_t, D>;
using D8 = hn::Rebind<std::uint8_t, D>;

constexpr int kMaxCount = 30;

/// Bits of a vector's cells.
struct Changed {
  std::uint64_t all = 0;
  std::uint64_t steady = 0;
};

/// One over each count.
HWY_INLINE V Share(hn::Vec<DI> count) {
  const D d;
  const DI di;
  // A division is slow; most cells have seen many frames.
  if (hn::AllTrue(di, hn::Eq(count, hn::Set(di, kMaxCount)))) return hn::Set(d, 1.0F / kMaxCount);
  return hn::Div(hn::Set(d, 1.0F), hn::ConvertTo(d, count));
}

/// Takes readings that agree with their cells, which have `count` of them now.
HWY_INLINE void Refine(const CellRow& row, int i, hn::Vec<DI> count, V height, V moved, V variance) {
  const D d;
  const D8 d8;
  const V share = Share(count);
  hn::StoreU(hn::Add(height, hn::Mul(moved, share)), d, row.inverse_depth_per_m + i);
  hn::StoreU(hn::Mul(variance, share), d, row.variance_per_m2 + i);
  hn::StoreU(hn::DemoteTo(d8, count), d8, row.count + i);
}

/// One vector of cells, and which of them changed.
HWY_INLINE Changed FuseCells(const FuseOptions& o, const CellRow& row, int i) {
  const D d;
  const DI di;
  const D8 d8;
  const auto raw = hn::PromoteTo(di, hn::LoadU(D16(), row.pixels + i));
  const V z = hn::Mul(hn::ConvertTo(d, raw), hn::Set(d, o.metres_per_unit));
  const auto usable = hn::And(hn::RebindMask(d, hn::Gt(raw, hn::Zero(di))),
                              hn::And(hn::Ge(z, hn::Set(d, o.depth_min_m)), hn::Le(z, hn::Set(d, o.depth_max_m))));
  const V one = hn::Set(d, 1.0F);
  const V height = hn::Div(one, hn::IfThenElse(usable, z, one));
  const V height2 = hn::Mul(height, height);
  const V off = hn::Sub(one, hn::Mul(hn::Set(d, o.noise.reference_m), height));
  const V sigma = hn::Add(hn::Mul(hn::Set(d, o.noise.constant_m), height2),
                          hn::Mul(hn::Set(d, o.noise.quadratic_per_m), hn::Mul(off, off)));
  const V variance = hn::Add(hn::Mul(sigma, sigma), hn::Set(d, o.noise.rounding_variance_per_m2));
  hn::StoreU(hn::IfThenElseZero(usable, z), d, row.depth_m + i);

  const auto count = hn::PromoteTo(di, hn::LoadU(d8, row.count + i));
  if (!o.fuse) {
    const auto usable_i = hn::RebindMask(di, usable);
    hn::StoreU(hn::IfThenElseZero(usable, height), d, row.inverse_depth_per_m + i);
    hn::StoreU(variance, d, row.variance_per_m2 + i);
    hn::StoreU(hn::DemoteTo(d8, hn::IfThenElseZero(usable_i, hn::Set(di, 1))), d8, row.count + i);
    hn::StoreU(hn::Zero(d8), d8, row.strikes + i);
    return {};
  }
  const auto had = hn::RebindMask(d, hn::Gt(count, hn::Zero(di)));
  const auto struck = hn::Gt(hn::PromoteTo(di, hn::LoadU(d8, row.strikes + i)), hn::Zero(di));
  const V cell_height = hn::LoadU(d, row.inverse_depth_per_m + i);
  const V cell_variance = hn::LoadU(d, row.variance_per_m2 + i);
  const V moved = hn::Sub(height, cell_height);
  const V moved2 = hn::Mul(moved, moved);
  const V expected = hn::Add(variance, cell_variance);
  const auto beyond3 = hn::Gt(moved2, hn::Mul(hn::Set(d, 9.0F), expected));
  const auto beyond5 = hn::Gt(moved2, hn::Mul(hn::Set(d, 25.0F), expected));
  const auto known = hn::And(usable, had);
  const auto again = hn::Or(beyond5, hn::And(beyond3, hn::RebindMask(d, struck)));
  const auto restart = hn::And(usable, hn::Or(hn::Not(had), again));
  const auto refine = hn::AndNot(beyond3, known);
  const auto strike = hn::And(known, hn::AndNot(again, beyond3));

  const auto more = hn::Min(hn::Add(count, hn::Set(di, 1)), hn::Set(di, kMaxCount));
  if (hn::AllTrue(d, refine)) {  // nearly everywhere, where nothing moves
    Refine(row, i, more, cell_height, moved, variance);
    hn::StoreU(hn::Zero(d8), d8, row.strikes + i);
    return {};
  }
  auto new_count = hn::IfThenElseZero(hn::RebindMask(di, strike), count);
  new_count = hn::IfThenElse(hn::RebindMask(di, refine), more, new_count);
  new_count = hn::IfThenElse(hn::RebindMask(di, restart), hn::Set(di, 1), new_count);
  const V share = Share(more);
  V new_height = hn::IfThenElseZero(usable, cell_height);
  new_height = hn::IfThenElse(refine, hn::Add(cell_height, hn::Mul(moved, share)), new_height);
  new_height = hn::IfThenElse(restart, height, new_height);
  V new_variance = hn::IfThenElse(refine, hn::Mul(variance, share), cell_variance);
  new_variance = hn::IfThenElse(restart, variance, new_variance);
  hn::StoreU(new_height, d, row.inverse_depth_per_m + i);
  hn::StoreU(new_variance, d, row.variance_per_m2 + i);
  hn::StoreU(hn::DemoteTo(d8, new_count), d8, row.count + i);
  hn::StoreU(hn::DemoteTo(d8, hn::IfThenElseZero(hn::RebindMask(di, strike), hn::Set(di, 1))), d8, row.strikes + i);
  const auto changed = hn::Or(restart, hn::AndNot(usable, had));
  if (hn::AllFalse(d, changed)) return {};
  const auto steady = hn::RebindMask(d, hn::Gt(count, hn::Set(di, kSteadyCount - 1)));
  return {Bits(changed), Bits(hn::And(changed, steady))};
}

/// The last cells of a row, fewer than a vector: on copies, so that nothing beyond the row is touched.
Changed FuseTail(const FuseOptions& o, const CellRow& row, int i, int cells) {
  std::uint16_t pixels[16] = {};
  float depth_m[16] = {};
  float inverse_depth_per_m[16] = {};
  float variance_per_m2[16] = {};
  std::uint8_t count[16] = {};
  std::uint8_t strikes[16] = {};
  std::copy_n(row.pixels + i, cells, pixels);
  std::copy_n(row.inverse_depth_per_m + i, cells, inverse_depth_per_m);
  std::copy_n(row.variance_per_m2 + i, cells, variance_per_m2);
  std::copy_n(row.count + i, cells, count);
  std::copy_n(row.strikes + i, cells, strikes);
  const Changed changed = FuseCells(o, {pixels, depth_m, inverse_depth_per_m, variance_per_m2, count, strikes}, 0);
  std::copy_n(depth_m, cells, row.depth_m + i);
  std::copy_n(inverse_depth_per_m, cells, row.inverse_depth_per_m + i);
  std::copy_n(variance_per_m2, cells, row.variance_per_m2 + i);
  std::copy_n(count, cells, row.count + i);
  std::copy_n(strikes, cells, row.strikes + i);
  return changed;
}

/// Counts the changed cells of a vector that begins in column `u`. A vector seldom lies in two tiles.
HWY_INLINE void Count(const Changed& changed, int u, int lanes, TileChanges* tiles) {
  const int column = u / kTileWidth_px;
  if ((u + lanes - 1) / kTileWidth_px == column) {
    tiles[column].all += static_cast<std::uint32_t>(std::popcount(changed.all));
    tiles[column].steady += static_cast<std::uint32_t>(std::popcount(changed.steady));
    return;
  }
  for (std::uint64_t bits = changed.all; bits != 0; bits &= bits - 1) {
    const int lane = std::countr_zero(bits);
    TileChanges& tile = tiles[(u + lane) / kTileWidth_px];
    ++tile.all;
    tile.steady += changed.steady >> lane & 1;
  }
}

void FuseRow(const FuseOptions& options, const CellRow& row, int u_first, int cells, TileChanges* tiles) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  for (int i = 0; i < cells; i += lanes) {
    const int here = std::min(lanes, cells - i);
    const Changed changed = here == lanes ? FuseCells(options, row, i) : FuseTail(options, row, i, here);
    if (changed.all != 0) Count(changed, u_first + i, here, tiles);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(FuseRow);

void fuse_row(const FuseOptions& options, const CellRow& row, int u_first, int cells, TileChanges* tiles) {
  HWY_DYNAMIC_DISPATCH(FuseRow)(options, row, u_first, cells, tiles);
}

}  // namespace tubetrack
#endif
