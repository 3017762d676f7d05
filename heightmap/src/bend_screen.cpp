#include <algorithm>
#include <bit>

#include "surfel_row.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bend_screen.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

#include "beside-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

/// After minus before; the plane in the middle stands in for a side without one.
HWY_INLINE V Difference(const Between& between, const float* before, const float* middle, const float* after) {
  const D d;
  const V center = hn::LoadU(d, middle);
  return hn::Sub(hn::IfThenElse(between.after, hn::LoadU(d, after), center),
                 hn::IfThenElse(between.before, hn::LoadU(d, before), center));
}

/// Whether the inverse depth bends down in some direction by more than `sigmas` of the second difference's noise, and
/// by more than `least` (1/m per pixel squared): whether its second derivatives plus that limit are not positive
/// definite.
HWY_INLINE M BendsDown(const Neighbourhood& n, int i, const Between& across, const Between& down, float aspect,
                       float sigmas, float least) {
  const int h = n.half;
  const float* u = n.row.slope_u + i;
  const float* v = n.row.slope_v + i;
  const V per_row = hn::Mul(down.per_px, Set(aspect));
  const V uu = hn::Mul(Difference(across, u - h, u, u + h), across.per_px);
  const V vv = hn::Mul(Difference(down, n.above.slope_v + i, v, n.below.slope_v + i), hn::Mul(per_row, Set(aspect)));
  const V vu = hn::Mul(Difference(across, v - h, v, v + h), hn::Mul(across.per_px, Set(aspect)));
  const V uv = hn::Mul(Difference(down, n.above.slope_u + i, u, n.below.slope_u + i), per_row);
  const V mixed = hn::Mul(Set(0.5F), hn::Add(uv, vu));
  const V noise = hn::Mul(hn::Mul(hn::LoadU(D(), n.row.slope_sigma + i), Set(sigmas * kRoot2)),
                          hn::Max(across.per_px, down.per_px));
  const V limit = hn::Max(noise, Set(least));
  const V a = hn::Add(uu, limit);
  const V b = hn::Add(vv, limit);
  return hn::Or(hn::Le(a, hn::Zero(D())), hn::Le(hn::Mul(a, b), hn::Mul(mixed, mixed)));
}

/// The same of a vector whose planes are known on all sides: step by step as above, as it depends on the vector's
/// length which of the two a cell gets.
HWY_INLINE M BendsDownWithin(const Neighbourhood& n, int i, V left_u, V right_u, V above_u, V below_u, float aspect,
                             float sigmas, float least) {
  const D d;
  const int h = n.half;
  const V per_px = Set(0.5F * (1.0F / static_cast<float>(h)));
  const V per_row = hn::Mul(per_px, Set(aspect));
  const float* v = n.row.slope_v + i;
  const V uu = hn::Mul(hn::Sub(right_u, left_u), per_px);
  const V vv = hn::Mul(hn::Sub(hn::LoadU(d, n.below.slope_v + i), hn::LoadU(d, n.above.slope_v + i)),
                       hn::Mul(per_row, Set(aspect)));
  const V vu = hn::Mul(hn::Sub(hn::LoadU(d, v + h), hn::LoadU(d, v - h)), per_row);
  const V uv = hn::Mul(hn::Sub(below_u, above_u), per_row);
  const V mixed = hn::Mul(Set(0.5F), hn::Add(uv, vu));
  const V noise = hn::Mul(hn::Mul(hn::LoadU(d, n.row.slope_sigma + i), Set(sigmas * kRoot2)), per_px);
  const V limit = hn::Max(noise, Set(least));
  const V a = hn::Add(uu, limit);
  const V b = hn::Add(vv, limit);
  return hn::Or(hn::Le(a, hn::Zero(d)), hn::Le(hn::Mul(a, b), hn::Mul(mixed, mixed)));
}

int ListCandidates(const SurfelRule& rule, const Neighbourhood n, int begin, int end, const std::uint64_t* found,
                   std::int32_t* candidates) {
  const D d;
  const int step = static_cast<int>(hn::Lanes(d));
  const float aspect = rule.fy_px / rule.fx_px;
  const float screen_sigmas = rule.screen_sigmas * std::max(1.0F, aspect);
  int count = 0;
  for (int i = begin; i < end; i += step) {
    const V limit = Set(0.5F * kNoPlane);
    const V here = hn::LoadU(d, n.row.slope_u + i);
    M bends = hn::Lt(here, limit);
    if (hn::AllFalse(d, bends)) continue;
    const V left = hn::LoadU(d, n.row.slope_u + i - n.half);
    const V right = hn::LoadU(d, n.row.slope_u + i + n.half);
    const V above = hn::LoadU(d, n.above.slope_u + i);
    const V below = hn::LoadU(d, n.below.slope_u + i);
    if (hn::AllTrue(d, hn::Lt(hn::Max(hn::Max(here, left), hn::Max(right, hn::Max(above, below))), limit))) {
      bends = BendsDownWithin(n, i, left, right, above, below, aspect, screen_sigmas, rule.screen_bend_per_m);
    } else {
      const Between across = Spread(left, right, n.half);
      const Between down = Spread(above, below, n.half);
      bends = hn::And(bends, hn::And(across.known, down.known));
      if (hn::AllFalse(d, bends)) continue;
      bends = hn::And(bends, BendsDown(n, i, across, down, aspect, screen_sigmas, rule.screen_bend_per_m));
    }
    const int padded = n.u_begin + i + kMargin_px;
    std::uint64_t bits = Bits(bends) & ~(found[padded / 64] >> (padded % 64));
    for (; bits != 0; bits &= bits - 1) candidates[count++] = i + std::countr_zero(bits);
  }
  return count;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(ListCandidates);

int list_candidates(const SurfelRule& rule, const Neighbourhood& n, int begin, int end, const std::uint64_t* found,
                    std::int32_t* candidates) {
  return HWY_DYNAMIC_DISPATCH(ListCandidates)(rule, n, begin, end, found, candidates);
}

}  // namespace tubetrack
#endif
