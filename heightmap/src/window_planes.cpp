#include "window_planes.hpp"

#include <algorithm>
#include <array>

#include "tubetrack/heightmap/normals.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "window_planes.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using DU = hn::Rebind<std::uint32_t, D>;
using DI = hn::Rebind<std::int32_t, D>;
using V = hn::Vec<D>;
using VU = hn::Vec<DU>;

HWY_INLINE hn::Mask<D> MaskOf(std::uint64_t bits) {
  return hn::LoadMaskBits(D(), reinterpret_cast<const std::uint8_t*>(&bits));  // little-endian, as Highway's targets
}

HWY_INLINE V Signed(VU sum) {
  return hn::ConvertTo(D(), hn::BitCast(DI(), sum));
}

/// The four corners of a window in the table: sums over the window are differences of them.
struct Corners {
  const std::uint32_t* top;
  const std::uint32_t* bottom;
  std::size_t stride;
  std::size_t left;
  std::size_t right;

  HWY_INLINE VU sum(int channel) const {
    const DU d;
    const std::size_t at = static_cast<std::size_t>(channel) * stride;
    return hn::Sub(hn::Sub(hn::LoadU(d, bottom + at + right), hn::LoadU(d, bottom + at + left)),
                   hn::Sub(hn::LoadU(d, top + at + right), hn::LoadU(d, top + at + left)));
  }
};

/// What of a full window is constant: the moments of (du, dv), as factors.
struct FullWindow {
  float per_cell;
  float per_moment;
  float variance_per_moment;

  explicit FullWindow(int half) {
    const int side = 2 * half + 1;
    const float cells = static_cast<float>(side * side);
    const int squares = side * side * half * (half + 1) / 3;  // Σ du², a whole number
    const auto moment = static_cast<float>(squares);
    per_cell = kHeightUnit_per_m / cells;
    per_moment = kHeightUnit_per_m / moment;
    variance_per_moment = kVarianceUnit_per_m2 / cells / moment;
  }
};

struct Planes {
  V slope_u;
  V slope_v;
  V slope_variance;
  V height;
  hn::Mask<D> known;
};

HWY_INLINE Planes FullWindows(const Corners& window, const FullWindow& full, VU u, VU v) {
  const D d;
  const VU h = window.sum(kH);
  const V slope = hn::Set(d, full.per_moment);
  return {hn::Mul(Signed(hn::Sub(window.sum(kUH), hn::Mul(u, h))), slope),
          hn::Mul(Signed(hn::Sub(window.sum(kVH), hn::Mul(v, h))), slope),
          hn::Mul(Signed(window.sum(kVariance)), hn::Set(d, full.variance_per_moment)),
          hn::Mul(Signed(h), hn::Set(d, full.per_cell)), hn::Gt(Signed(h), hn::Zero(d))};
}

/// Windows with gaps: the moments are summed, and solved for. No plane where too few cells or no slope is determined.
HWY_INLINE Planes WindowsWithHoles(const Corners& window, int half, VU u, VU v) {
  const D d;
  const float cells = static_cast<float>((2 * half + 1) * (2 * half + 1));
  const VU count = window.sum(kCount);
  const VU sum_u = window.sum(kU);
  const VU sum_v = window.sum(kV);
  const VU sum_h = window.sum(kH);
  const VU sum_du = hn::Sub(sum_u, hn::Mul(u, count));
  const VU sum_dv = hn::Sub(sum_v, hn::Mul(v, count));
  const VU sum_dudu = hn::Sub(window.sum(kUU), hn::Mul(u, hn::Add(sum_u, sum_du)));
  const VU sum_dvdv = hn::Sub(window.sum(kVV), hn::Mul(v, hn::Add(sum_v, sum_dv)));
  const VU sum_dudv = hn::Sub(hn::Sub(window.sum(kUV), hn::Mul(u, sum_v)), hn::Mul(v, sum_du));
  const V n = Signed(count);
  const auto enough = hn::Ge(n, hn::Set(d, 0.6F * cells));
  const V safe_n = hn::IfThenElse(enough, n, hn::Set(d, 1.0F));
  const V mean_u = hn::Div(Signed(sum_du), safe_n);
  const V mean_v = hn::Div(Signed(sum_dv), safe_n);
  const V mean_h = hn::Div(Signed(sum_h), safe_n);
  const V suu = hn::Sub(Signed(sum_dudu), hn::Mul(Signed(sum_du), mean_u));
  const V suv = hn::Sub(Signed(sum_dudv), hn::Mul(Signed(sum_du), mean_v));
  const V svv = hn::Sub(Signed(sum_dvdv), hn::Mul(Signed(sum_dv), mean_v));
  const V suh = hn::Sub(Signed(hn::Sub(window.sum(kUH), hn::Mul(u, sum_h))), hn::Mul(Signed(sum_du), mean_h));
  const V svh = hn::Sub(Signed(hn::Sub(window.sum(kVH), hn::Mul(v, sum_h))), hn::Mul(Signed(sum_dv), mean_h));
  const V product = hn::Mul(suu, svv);
  const V det = hn::Sub(product, hn::Mul(suv, suv));
  const auto known = hn::And(enough, hn::Gt(det, hn::Mul(hn::Set(d, 1e-3F), product)));
  const V scale = hn::Div(hn::Set(d, kHeightUnit_per_m), hn::IfThenElse(known, det, hn::Set(d, 1.0F)));
  const V slope_u = hn::Mul(hn::Sub(hn::Mul(suh, svv), hn::Mul(svh, suv)), scale);
  const V slope_v = hn::Mul(hn::Sub(hn::Mul(svh, suu), hn::Mul(suh, suv)), scale);
  const V height = hn::Sub(hn::Mul(mean_h, hn::Set(d, kHeightUnit_per_m)),
                           hn::Add(hn::Mul(slope_u, mean_u), hn::Mul(slope_v, mean_v)));
  const V variance = hn::Div(hn::Mul(Signed(window.sum(kVariance)), hn::Set(d, kVarianceUnit_per_m2)), safe_n);
  const V least = hn::IfThenElse(known, hn::Min(suu, svv), hn::Set(d, 1.0F));
  return {slope_u, slope_v, hn::Div(variance, least), height, hn::And(known, hn::Gt(height, hn::Zero(d)))};
}

HWY_INLINE Planes Choose(hn::Mask<D> mask, const Planes& yes, const Planes& no) {
  return {hn::IfThenElse(mask, yes.slope_u, no.slope_u), hn::IfThenElse(mask, yes.slope_v, no.slope_v),
          hn::IfThenElse(mask, yes.slope_variance, no.slope_variance), hn::IfThenElse(mask, yes.height, no.height),
          hn::Or(hn::And(mask, yes.known), hn::AndNot(mask, no.known))};
}

/// The planes of one vector, some of whose windows don't fit or have holes. `fit` and `with_holes` have a bit a lane.
HWY_NOINLINE void PlanesOfSome(const Corners& window, int half, VU u, VU v, std::uint64_t fit, std::uint64_t with_holes,
                               int i, const PlaneRow& out) {
  const D d;
  // Each cell by its own window: were it by the vector's, the rounding would depend on the vector's length and place.
  Planes planes = FullWindows(window, FullWindow(half), u, v);
  if (with_holes != 0) planes = Choose(MaskOf(with_holes), WindowsWithHoles(window, half, u, v), planes);
  const auto known = hn::And(planes.known, MaskOf(fit));
  hn::StoreU(hn::IfThenElse(known, planes.slope_u, hn::Set(d, kNoPlane)), d, out.slope_u + i);
  hn::StoreU(planes.slope_v, d, out.slope_v + i);
  hn::StoreU(hn::Sqrt(planes.slope_variance), d, out.slope_sigma + i);
  hn::StoreU(planes.height, d, out.height + i);
}

template <int kHalf>
void PlanesOfSize(const std::uint32_t* top, const std::uint32_t* bottom, std::size_t stride, int u_begin, int v,
                  int columns, const std::uint64_t* fits, const std::uint64_t* holes, const PlaneRow out) {
  const D d;
  const DU du;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const VU row = hn::Set(du, static_cast<std::uint32_t>(v));
  const VU lane = hn::Iota(du, 0U);  // slow where it is needed anew
  const FullWindow full_window(kHalf);
  const std::uint64_t all = (std::uint64_t{1} << lanes) - 1;
  for (int i = 0; i < columns; i += lanes) {
    const auto padded = static_cast<unsigned>(u_begin + i + kMargin_px);
    const std::uint64_t fit = fits[padded / 64] >> (padded % 64) & all;
    if (fit == 0) {
      hn::StoreU(hn::Set(d, kNoPlane), d, out.slope_u + i);
      continue;
    }
    const auto at = static_cast<std::size_t>(i);
    const Corners window{top, bottom, stride, at, at + 2 * kHalf + 1};
    const VU u = hn::Add(lane, hn::Set(du, static_cast<std::uint32_t>(u_begin + i)));
    const std::uint64_t with_holes = holes[padded / 64] >> (padded % 64) & fit;
    if (fit != all || with_holes != 0) {
      PlanesOfSome(window, kHalf, u, row, fit, with_holes, i, out);
      continue;
    }
    const Planes planes = FullWindows(window, full_window, u, row);  // all are known
    hn::StoreU(planes.slope_u, d, out.slope_u + i);
    hn::StoreU(planes.slope_v, d, out.slope_v + i);
    hn::StoreU(hn::Sqrt(planes.slope_variance), d, out.slope_sigma + i);
    hn::StoreU(planes.height, d, out.height + i);
  }
}

/// `top`, `bottom`: the corners of the first cell's window are in these, the left ones first.
void PlanesOfRow(const std::uint32_t* top, const std::uint32_t* bottom, std::size_t stride, int half, int u_begin,
                 int v, int columns, const std::uint64_t* fits, const std::uint64_t* holes, const PlaneRow& out) {
  static_assert(kWindowHalfSizes_px == std::array{3, 6, 10});
  const auto planes = half == 3 ? PlanesOfSize<3> : half == 6 ? PlanesOfSize<6> : PlanesOfSize<10>;
  planes(top, bottom, stride, u_begin, v, columns, fits, holes, out);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(PlanesOfRow);

void PlaneRing::start(int half_px, int u_begin, int columns) {
  half_px_ = half_px;
  u_begin_ = u_begin;
  columns_ = columns;
  rows_ = static_cast<unsigned>(2 * half_px + 1);
  const std::size_t size = std::size_t{4} * rows_ * static_cast<std::size_t>(columns);
  if (ring_.size() < size) ring_.resize(size);
}

PlaneRow PlaneRing::row(int v) {
  const auto columns = static_cast<std::size_t>(columns_);
  float* start = ring_.data() + (static_cast<unsigned>(v) + rows_) % rows_ * 4 * columns;
  return {start, start + columns, start + 2 * columns, start + 3 * columns};
}

void planes_of_row(const WindowSums& sums, const BitImage& fits, const BitImage& holes, int v, int u_begin, int u_end,
                   PlaneRing& planes) {
  const int half = planes.half_px();
  const PlaneRow row = planes.row(v);
  const int at = planes.index(u_begin);
  const PlaneRow out{row.slope_u + at, row.slope_v + at, row.slope_sigma + at, row.height + at};
  if (v < half || v >= fits.grid.height - half) {
    std::fill_n(out.slope_u, u_end - u_begin, kNoPlane);
    return;
  }
  const int left = sums.index(u_begin) - half;
  HWY_DYNAMIC_DISPATCH(PlanesOfRow)
  (sums.row(v - half) + left, sums.row(v + half + 1) + left, sums.stride(), half, u_begin, v, u_end - u_begin,
   fits.row(v), holes.row(v), out);
}

}  // namespace tubetrack
#endif
