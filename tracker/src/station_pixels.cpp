#include "station_pixels.hpp"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "tubetrack/tracker/recycled.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "station_pixels.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Sums are of doubles, so all of it goes by as many pixels as a vector holds of them.
using DD = hn::CappedTag<double, 8>;
using D = hn::Rebind<float, DD>;
using DI = hn::Rebind<std::int32_t, DD>;
using DU = hn::Rebind<std::uint32_t, DD>;
using VD = hn::Vec<DD>;
using V = hn::Vec<D>;

/// A vector's pixels: their station, kind, and terms of ShapeSums, 0 for what is of another shape.
struct Judged {
  std::int32_t at[8];
  std::int32_t kind[8];
  double first_four[8 * 4];  ///< n, c, cc and r of each pixel
  double cr[8];
};

HWY_INLINE void Add(const Judged& judged, std::size_t lane, ShapeSums& shape) {
  const hn::CappedTag<double, 4> d;
  static_assert(offsetof(ShapeSums, r) == offsetof(ShapeSums, n) + 3 * sizeof(double));
  for (std::size_t i = 0; i < 4; i += hn::Lanes(d))
    hn::StoreU(hn::Add(hn::LoadU(d, &shape.n + i), hn::LoadU(d, judged.first_four + 4 * lane + i)), d, &shape.n + i);
  shape.cr += judged.cr[lane];
}

HWY_INLINE VD Number(double value) {
  return hn::Set(DD(), value);
}

HWY_INLINE VD Kind(PixelKind kind) {
  return Number(static_cast<double>(kind));
}

/// Readings of the pixels from `i` on; those of neighbours in a row stand side by side.
HWY_INLINE V Readings(const float* depth_m, const PredictedPixels& pixels, std::size_t i, hn::Mask<D> here) {
  const std::size_t last = i + hn::Lanes(DD()) - 1;
  if (last < pixels.count && pixels.cell[last] - pixels.cell[i] == last - i)
    return hn::LoadU(D(), depth_m + pixels.cell[i]);
  const auto cell = hn::BitCast(DI(), hn::LoadU(DU(), pixels.cell.data() + i));
  return hn::GatherIndex(D(), depth_m, hn::IfThenElseZero(hn::RebindMask(DI(), here), cell));
}

/// `agreement_m` and `add_to_shape`, step by step.
HWY_INLINE void Judge(V measured, double radius_m, const PredictedPixels& pixels, std::size_t i, Judged& out) {
  const D d;
  const DD dd;
  const V one = hn::Set(d, 1.0F);
  const V sigma = hn::LoadU(d, pixels.sigma_m.data() + i);
  const V lateral = hn::LoadU(d, pixels.lateral.data() + i);
  const VD reading = hn::PromoteTo(dd, measured);
  const VD off = hn::PromoteTo(dd, hn::Sub(measured, hn::LoadU(d, pixels.depth_m.data() + i)));
  const VD size = hn::Abs(off);
  const VD allowed = hn::Add(hn::Mul(Number(3.5), hn::PromoteTo(dd, sigma)), Number(0.05 * radius_m));
  VD kind = hn::IfThenElse(hn::Lt(off, hn::Zero(dd)), Kind(PixelKind::before), Kind(PixelKind::behind));
  kind = hn::IfThenElse(hn::Le(size, allowed), Kind(PixelKind::agrees), kind);
  kind = hn::IfThenElse(hn::Eq(reading, hn::Zero(dd)), Kind(PixelKind::no_reading), kind);
  kind = hn::IfThenElse(hn::Lt(reading, hn::Zero(dd)), Kind(PixelKind::anothers), kind);
  hn::StoreU(hn::DemoteTo(DI(), kind), DI(), out.kind);

  const VD gate = hn::Add(Number(0.6 * radius_m), hn::PromoteTo(dd, hn::Mul(hn::Set(d, 4.0F), sigma)));
  const auto in_shape = hn::And(hn::Gt(reading, hn::Zero(dd)), hn::Le(size, gate));
  const V cosine = hn::Sqrt(hn::Max(hn::Zero(d), hn::Sub(one, hn::Mul(lateral, lateral))));
  const V radii = hn::Div(hn::LoadU(d, pixels.across.data() + i), hn::Set(d, static_cast<float>(radius_m)));
  const V section_sigma = hn::Mul(sigma, radii);
  const V weight = hn::Div(one, hn::Mul(section_sigma, section_sigma));
  const VD n = hn::IfThenElseZero(in_shape, hn::PromoteTo(dd, weight));
  const VD cos_angle = hn::PromoteTo(dd, cosine);
  const VD c = hn::Mul(n, cos_angle);
  const VD section_off = hn::Mul(off, hn::PromoteTo(dd, radii));
  hn::StoreInterleaved4(n, c, hn::Mul(c, cos_angle), hn::Mul(n, section_off), dd, out.first_four);
  hn::StoreU(hn::Mul(c, section_off), dd, out.cr);
}

void TakePixels(const float* depth_m, double radius_m, const PredictedPixels& pixels, double per_span,
                std::span<StationPixels> stations) {
  const D d;
  const DI di;
  const auto last = static_cast<std::int32_t>(stations.size()) - 1;
  Judged judged;
  std::int32_t seen[8];
  constexpr std::size_t kAhead = 16;  // readings of the next row are far from these
  for (std::size_t i = 0; i < pixels.count; i += hn::Lanes(DD())) {
    hwy::Prefetch(depth_m + pixels.cell[std::min(i + kAhead, pixels.count - 1)]);
    const auto here = hn::And(hn::FirstN(d, pixels.count - i),
                              hn::Ge(hn::LoadU(d, pixels.cos_incidence.data() + i), hn::Set(d, kCos75)));
    if (hn::AllFalse(d, here)) continue;
    const VD place = hn::Mul(hn::PromoteTo(DD(), hn::LoadU(d, pixels.t.data() + i)), Number(per_span));
    const auto at = hn::Min(hn::Max(hn::DemoteTo(di, place), hn::Zero(di)), hn::Set(di, last));
    hn::StoreU(at, di, judged.at);
    hn::StoreU(hn::IfThenElseZero(hn::RebindMask(di, here), hn::Set(di, 1)), di, seen);
    Judge(Readings(depth_m, pixels, i, here), radius_m, pixels, i, judged);
    for (std::size_t lane = 0; lane < hn::Lanes(DD()); ++lane) {
      if (!seen[lane]) continue;
      StationPixels& station = stations[static_cast<std::size_t>(judged.at[lane])];
      ++station.count[static_cast<std::size_t>(judged.kind[lane])];
      Add(judged, lane, station.shape);
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(TakePixels);

void take_pixels(const float* depth_m, double radius_m, const PredictedPixels& pixels, double per_span,
                 std::span<StationPixels> stations) {
  HWY_DYNAMIC_DISPATCH(TakePixels)(depth_m, radius_m, pixels, per_span, stations);
}

}  // namespace tubetrack
#endif
