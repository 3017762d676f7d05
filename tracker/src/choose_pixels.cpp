#include "choose_pixels.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "tubetrack/sensors/disparity_levels.hpp"
#include "tubetrack/tracker/predict.hpp"
#include "tubetrack/tracker/recycled.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "choose_pixels.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Gates are kept in doubles, so all of it goes by as many pixels as a vector holds of them.
using DD = hn::CappedTag<double, 8>;
using D = hn::Rebind<float, DD>;
using DI = hn::Rebind<std::int32_t, DD>;
using DU = hn::Rebind<std::uint32_t, DD>;
using VD = hn::Vec<DD>;
using V = hn::Vec<D>;
using VI = hn::Vec<DI>;

HWY_INLINE VD Doubles(V value) {
  return hn::PromoteTo(DD(), value);
}

/// `depth_of_level_m`, step by step.
HWY_INLINE VD DepthOfLevel(const DisparityLevels& levels, VD reading) {
  const DD d;
  if (levels.per_level_m <= 0.0) return reading;
  const VD per_level = hn::Set(d, levels.per_level_m);
  const VD half = hn::Set(d, 0.5);
  const VD lowest = hn::Sub(reading, hn::Set(d, 0.501 * levels.unit_m));
  const VD number = hn::Max(hn::Set(d, 1.0), hn::Trunc(hn::Add(hn::Div(per_level, reading), half)));
  const VD nearest = hn::Div(per_level, number);
  const VD apart2 = hn::Set(d, 1.1 * levels.per_level_m * levels.unit_m);
  const auto too_near = hn::Le(lowest, hn::Zero(d));
  const auto one_level = hn::Gt(hn::Mul(nearest, nearest), apart2);
  VD depth = nearest;
  if (!hn::AllTrue(d, hn::Or(too_near, one_level))) {
    const VD highest = hn::Add(reading, hn::Set(d, 0.499 * levels.unit_m));
    const VD first = hn::Ceil(hn::Div(per_level, highest));
    const VD last = hn::Floor(hn::Div(per_level, lowest));
    const VD mean = hn::Mul(half, hn::Add(hn::Div(per_level, first), hn::Div(per_level, last)));
    depth = hn::IfThenElse(hn::Or(one_level, hn::Lt(last, first)), nearest, mean);
  }
  return hn::IfThenElse(too_near, reading, depth);
}

void ChoosePixels(const PixelChoice& choice, const PredictedPixels& pixels, ChosenPixels& chosen) {
  const D d;
  const DD dd;
  const DI di;
  const DU du;
  const V zero = hn::Zero(d);
  const VD one = hn::Set(dd, 1.0);
  std::size_t count = 0;
  for (std::size_t i = 0; i < pixels.count; i += hn::Lanes(dd)) {
    const VI cell = hn::BitCast(di, hn::LoadU(du, pixels.cell.data() + i));
    const V t = hn::LoadU(d, pixels.t.data() + i);
    const auto here = hn::And(hn::FirstN(d, pixels.count - i), hn::And(hn::Ge(t, hn::Set(d, choice.t_begin)),
                                                                      hn::Le(t, hn::Set(d, choice.t_end))));
    const auto seen = hn::And(hn::Ge(hn::LoadU(d, pixels.cos_incidence.data() + i), hn::Set(d, kCos75)),
                              hn::Ge(hn::LoadU(d, pixels.margin_px.data() + i), hn::Set(d, choice.least_margin_px)));
    const auto wanted = hn::And(here, seen);
    if (hn::AllFalse(d, wanted)) continue;
    // What lies behind the last pixel may be anything.
    const VI safe = hn::IfThenElseZero(hn::RebindMask(di, wanted), cell);
    const V measured = hn::GatherIndex(d, choice.depth_m, safe);
    const V sigma = hn::LoadU(d, pixels.sigma_m.data() + i);
    const VD depth = hn::Sub(DepthOfLevel(choice.levels, Doubles(measured)),
                             Doubles(hn::LoadU(d, pixels.jitter_bias_m.data() + i)));
    const VD off = hn::Abs(hn::Sub(depth, Doubles(hn::LoadU(d, pixels.depth_m.data() + i))));
    const VD noise = hn::Mul(hn::Set(dd, choice.sigmas), Doubles(sigma));
    const auto within = [&](double gate_m) HWY_ATTR {
      const auto inside = hn::Le(off, hn::Add(hn::Set(dd, gate_m), noise));
      return hn::Gt(hn::DemoteTo(d, hn::IfThenElseZero(inside, one)), zero);
    };
    const auto keep = hn::And(hn::And(wanted, hn::Gt(measured, zero)), within(choice.far_m));
    if (hn::AllFalse(d, keep)) continue;
    const auto is_near = hn::RebindMask(di, within(choice.near_m));
    const VI whole = hn::ConvertTo(di, hn::Mul(hn::Max(t, zero), hn::Set(d, 1.0F * choice.stretches_per_span)));
    const VI stretch = hn::Min(whole, hn::Set(di, choice.stretches - 1));
    const V per_span = hn::Set(d, 1.0F / choice.stretches_per_span);
    const VI span =
        hn::IfThenElseZero(hn::RebindMask(di, keep), hn::ConvertTo(di, hn::Mul(hn::ConvertTo(d, stretch), per_span)));
    const VI place = hn::Add(hn::Add(stretch, stretch), hn::IfThenElseZero(is_near, hn::Set(di, 1)));
    const VI ray = hn::Add(safe, safe);
    const V direction_x = hn::GatherIndex(d, choice.rays, ray);
    const V direction_y = hn::GatherIndex(d, choice.rays + 1, ray);
    const V depth_m = hn::DemoteTo(d, depth);
    const V spans = hn::Set(d, 1.0F * (choice.stretches / choice.stretches_per_span));
    const auto take = [&](const V& value, RecycledVector<float>& column)
                          HWY_ATTR { hn::StoreU(hn::Compress(value, keep), d, column.data() + count); };
    hn::StoreU(hn::Compress(hn::BitCast(du, place), hn::RebindMask(du, keep)), du, chosen.place.data() + count);
    // In floats: a hundred-millionth of the depth off, by chance.
    take(hn::Sub(hn::Mul(depth_m, direction_x), hn::GatherIndex(d, choice.origin_x_m, span)), chosen.x);
    take(hn::Sub(hn::Mul(depth_m, direction_y), hn::GatherIndex(d, choice.origin_y_m, span)), chosen.y);
    take(hn::Sub(depth_m, hn::GatherIndex(d, choice.origin_z_m, span)), chosen.z);
    take(direction_x, chosen.direction_x);
    take(direction_y, chosen.direction_y);
    take(hn::Div(hn::Set(d, 1.0F), hn::Mul(sigma, sigma)), chosen.weight);
    take(hn::Sub(hn::Min(hn::Max(t, zero), spans), hn::ConvertTo(d, span)), chosen.s);
    count += hn::CountTrue(d, keep);
  }
  chosen.count = count;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(ChoosePixels);

void ChosenPixels::make_room(std::size_t pixels) {
  const std::size_t room = pixels + kSpare;
  if (place.size() >= room) return;
  place.resize(room);
  for (RecycledVector<float>* column : {&x, &y, &z, &direction_x, &direction_y, &weight, &s}) column->resize(room);
}

void choose_pixels(const PixelChoice& choice, const PredictedPixels& pixels, ChosenPixels& chosen) {
  chosen.make_room(pixels.size());
  HWY_DYNAMIC_DISPATCH(ChoosePixels)(choice, pixels, chosen);
}

}  // namespace tubetrack
#endif
