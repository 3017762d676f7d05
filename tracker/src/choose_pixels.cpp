#include "choose_pixels.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "stretch_sums.hpp"
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

/// Are those from `i` on, as many as a vector holds, neighbours in a row of the image?
HWY_INLINE bool AreNeighbours(const PredictedPixels& pixels, std::size_t i) {
  const std::size_t last = i + hn::Lanes(DD()) - 1;
  return last < pixels.count && pixels.cell[last] - pixels.cell[i] == last - i;
}

void ChoosePixels(const PixelChoice& choice, const PredictedPixels& pixels, ChosenPixels& chosen) {
  const D d;
  const DD dd;
  const DI di;
  const DU du;
  const V zero = hn::Zero(d);
  const VD one = hn::Set(dd, 1.0);
  const int span_count = choice.stretches / kStretchesPerSpan;
  const V spans = hn::Set(d, static_cast<float>(span_count));
  std::size_t count = 0;
  for (std::size_t i = 0; i < pixels.count; i += hn::Lanes(dd)) {
    const V t = hn::LoadU(d, pixels.t.data() + i);
    const auto here = hn::And(hn::FirstN(d, pixels.count - i),
                              hn::And(hn::Ge(t, hn::Set(d, choice.t_begin)), hn::Le(t, hn::Set(d, choice.t_end))));
    const auto seen = hn::And(hn::Ge(hn::LoadU(d, pixels.cos_incidence.data() + i), hn::Set(d, kCos75)),
                              hn::Ge(hn::LoadU(d, pixels.margin_px.data() + i), hn::Set(d, choice.least_margin_px)));
    const auto wanted = hn::And(here, seen);
    if (hn::AllFalse(d, wanted)) continue;
    V measured, direction_x, direction_y;
    if (AreNeighbours(pixels, i)) {  // gathers take longer than all else
      measured = hn::LoadU(d, choice.depth_m + pixels.cell[i]);
      hn::LoadInterleaved2(d, choice.rays + std::size_t{2} * pixels.cell[i], direction_x, direction_y);
    } else {
      // What lies behind the last pixel may be anything.
      const VI cell =
          hn::IfThenElseZero(hn::RebindMask(di, wanted), hn::BitCast(di, hn::LoadU(du, pixels.cell.data() + i)));
      measured = hn::GatherIndex(d, choice.depth_m, cell);
      direction_x = hn::GatherIndex(d, choice.rays, hn::Add(cell, cell));
      direction_y = hn::GatherIndex(d, choice.rays + 1, hn::Add(cell, cell));
    }
    const V sigma = hn::LoadU(d, pixels.sigma_m.data() + i);
    const VD depth =
        hn::Sub(DepthOfLevel(choice.levels, Doubles(measured)), Doubles(hn::LoadU(d, pixels.jitter_bias_m.data() + i)));
    const VD off = hn::Abs(hn::Sub(depth, Doubles(hn::LoadU(d, pixels.depth_m.data() + i))));
    const VD noise = hn::Mul(hn::Set(dd, choice.sigmas), Doubles(sigma));
    const auto within = [&](double gate_m) HWY_ATTR {
      const auto inside = hn::Le(off, hn::Add(hn::Set(dd, gate_m), noise));
      return hn::Gt(hn::DemoteTo(d, hn::IfThenElseZero(inside, one)), zero);
    };
    const auto keep = hn::And(hn::And(wanted, hn::Gt(measured, zero)), within(choice.far_m));
    if (hn::AllFalse(d, keep)) continue;
    const auto is_near = hn::RebindMask(di, within(choice.near_m));
    const V begun = hn::Max(t, zero);
    const VI whole = hn::ConvertTo(di, hn::Mul(begun, hn::Set(d, static_cast<float>(kStretchesPerSpan))));
    const VI stretch = hn::Min(whole, hn::Set(di, choice.stretches - 1));
    const VI span =
        hn::ConvertTo(di, hn::Mul(hn::ConvertTo(d, stretch), hn::Set(d, 1.0F / static_cast<float>(kStretchesPerSpan))));
    const VI place = hn::Add(hn::Add(stretch, stretch), hn::IfThenElseZero(is_near, hn::Set(di, 1)));
    const V s = hn::Sub(hn::Min(begun, spans), hn::ConvertTo(d, span));
    const V depth_m = hn::DemoteTo(d, depth);
    const V weight = hn::Div(hn::Set(d, 1.0F), hn::Mul(sigma, sigma));
    const bool all = hn::AllTrue(d, keep);  // as mostly
    const auto kept = [&](V value) HWY_ATTR { return all ? value : hn::Compress(value, keep); };
    hn::StoreU(hn::Compress(hn::BitCast(du, place), hn::RebindMask(du, keep)), du, chosen.place.data() + count);
    hn::StoreInterleaved4(kept(hn::Mul(depth_m, direction_x)), kept(hn::Mul(depth_m, direction_y)), kept(depth_m),
                          kept(weight), d, &chosen.points[count].x);
    hn::StoreInterleaved4(kept(direction_x), kept(direction_y), hn::Set(d, 1.0F), kept(s), d, &chosen.rays[count].x);
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
  points.resize(room);
  rays.resize(room);
}

void choose_pixels(const PixelChoice& choice, const PredictedPixels& pixels, ChosenPixels& chosen) {
  chosen.make_room(pixels.size());
  HWY_DYNAMIC_DISPATCH(ChoosePixels)(choice, pixels, chosen);
}

}  // namespace tubetrack
#endif
