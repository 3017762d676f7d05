#include "choose_pixels.hpp"

#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

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

using D = hn::CappedTag<float, ChosenPixels::kSpare>;
using DI = hn::Rebind<std::int32_t, D>;
using DU = hn::Rebind<std::uint32_t, D>;
using V = hn::Vec<D>;
using VI = hn::Vec<DI>;

HWY_INLINE V Number(double value) {
  return hn::Set(D(), static_cast<float>(value));
}

/// A bit for each lane.
HWY_INLINE std::uint64_t Bits(hn::Mask<D> mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(D(), mask, bytes);
  return bytes[0] | static_cast<std::uint64_t>(bytes[1]) << 8;
}

/// `depth_of_level_m` one by one, where `asked`.
HWY_NOINLINE V DepthsOfLevels(const DisparityLevels& levels, V reading, hn::Mask<D> asked, V otherwise) {
  const D d;
  float readings[ChosenPixels::kSpare], depths[ChosenPixels::kSpare], wanted[ChosenPixels::kSpare];
  hn::StoreU(reading, d, readings);
  hn::StoreU(otherwise, d, depths);
  hn::StoreU(hn::IfThenElseZero(asked, Number(1.0)), d, wanted);
  for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
    if (wanted[lane] != 0.0F) depths[lane] = static_cast<float>(depth_of_level_m(levels, readings[lane]));
  }
  return hn::LoadU(d, depths);
}

/// `depth_of_level_m`, step by step. In floats the number of a level is off by some hundred-thousandths, which is far
/// less than how far a unit's ends are kept apart; the depth by some hundred-millionths. Readings half way between two
/// levels are asked for in doubles.
HWY_INLINE V DepthOfLevel(const DisparityLevels& levels, V reading) {
  const D d;
  if (levels.per_level_m <= 0.0) return reading;
  const V per_level = Number(levels.per_level_m);
  const V half = Number(0.5);
  const V lowest = hn::Sub(reading, Number(0.501 * levels.unit_m));
  const V levels_there = hn::Add(hn::Div(per_level, reading), half);
  const V whole = hn::Trunc(levels_there);
  const V nearest = hn::Div(per_level, hn::Max(Number(1.0), whole));
  const V apart2 = Number(1.1 * levels.per_level_m * levels.unit_m);
  const auto too_near = hn::Le(lowest, hn::Zero(d));
  const auto one_level = hn::Gt(hn::Mul(nearest, nearest), apart2);
  V depth = nearest;
  if (!hn::AllTrue(d, hn::Or(too_near, one_level))) {
    const V highest = hn::Add(reading, Number(0.499 * levels.unit_m));
    const V first = hn::Ceil(hn::Div(per_level, highest));
    const V last = hn::Floor(hn::Div(per_level, lowest));
    const V mean = hn::Mul(half, hn::Add(hn::Div(per_level, first), hn::Div(per_level, last)));
    depth = hn::IfThenElse(hn::Or(one_level, hn::Lt(last, first)), nearest, mean);
  }
  depth = hn::IfThenElse(too_near, reading, depth);
  const V beyond = hn::Sub(levels_there, whole);
  const auto half_way = hn::Lt(hn::Min(beyond, hn::Sub(Number(1.0), beyond)), Number(3e-4));
  const auto in_doubt = hn::And(half_way, hn::Gt(reading, hn::Zero(d)));
  return hn::AllFalse(d, in_doubt) ? depth : DepthsOfLevels(levels, reading, in_doubt, depth);
}

/// Readings and rays of the pixels from `i` on, of which `left` are wanted. What is behind those may be anything.
HWY_INLINE void LoadReadings(const PixelChoice& choice, const PredictedPixels& pixels, std::size_t i, std::size_t left,
                             V& measured, V& ray_x, V& ray_y) {
  const D d;
  const DI di;
  const DU du;
  const std::size_t lanes = hn::Lanes(d);
  const std::uint32_t first = pixels.cell[i];
  const std::size_t last = i + std::min(left, lanes) - 1;
  // Mostly they are neighbours, and gathers take longer than all else.
  if (pixels.cell[last] - first == last - i && first + lanes <= choice.cells) {
    measured = hn::LoadU(d, choice.depth_m + first);
    hn::LoadInterleaved2(d, choice.rays + std::size_t{2} * first, ray_x, ray_y);
    return;
  }
  const VI cell = hn::IfThenElseZero(hn::FirstN(di, left), hn::BitCast(di, hn::LoadU(du, pixels.cell.data() + i)));
  measured = hn::GatherIndex(d, choice.depth_m, cell);
  ray_x = hn::GatherIndex(d, choice.rays, hn::Add(cell, cell));
  ray_y = hn::GatherIndex(d, choice.rays + 1, hn::Add(cell, cell));
}

/// The same for a vector of pixels from `i` on, of which those before `end` are wanted.
HWY_INLINE void ChooseVector(const PixelChoice& choice, const PredictedPixels& pixels, std::size_t i, std::size_t end,
                             ChosenPixels& chosen) {
  constexpr std::size_t kAhead = 16;  // those of the next row are far from these
  const std::size_t ahead = pixels.cell[std::min(i + kAhead, pixels.count - 1)];
  hwy::Prefetch(choice.depth_m + ahead);
  hwy::Prefetch(choice.rays + 2 * ahead);
  const D d;
  const DI di;
  const DU du;
  const V zero = hn::Zero(d);
  const V t = hn::LoadU(d, pixels.t.data() + i);
  const auto here = hn::And(hn::FirstN(d, end - i),
                            hn::And(hn::Ge(t, hn::Set(d, choice.t_begin)), hn::Le(t, hn::Set(d, choice.t_end))));
  const auto seen = hn::And(hn::Ge(hn::LoadU(d, pixels.cos_incidence.data() + i), hn::Set(d, kCos75)),
                            hn::Ge(hn::LoadU(d, pixels.margin_px.data() + i), hn::Set(d, choice.least_margin_px)));
  const auto wanted = hn::And(here, seen);
  if (hn::AllFalse(d, wanted)) return;
  V measured, direction_x, direction_y;
  LoadReadings(choice, pixels, i, end - i, measured, direction_x, direction_y);
  const V sigma = hn::LoadU(d, pixels.sigma_m.data() + i);
  const V depth_m = hn::Sub(DepthOfLevel(choice.levels, measured), hn::LoadU(d, pixels.jitter_bias_m.data() + i));
  const V off = hn::Abs(hn::Sub(depth_m, hn::LoadU(d, pixels.depth_m.data() + i)));
  const V noise = hn::Mul(hn::Set(d, choice.sigmas), sigma);
  const auto is_far = hn::Le(off, hn::Add(hn::Set(d, choice.far_m), noise));
  const auto keep = hn::And(hn::And(wanted, hn::Gt(measured, zero)), is_far);
  if (hn::AllFalse(d, keep)) return;
  const auto is_near = hn::RebindMask(di, hn::Le(off, hn::Add(hn::Set(d, choice.near_m), noise)));
  const V begun = hn::Max(t, zero);
  const VI whole = hn::ConvertTo(di, hn::Mul(begun, hn::Set(d, static_cast<float>(kStretchesPerSpan))));
  const VI stretch = hn::Min(whole, hn::Set(di, choice.stretches - 1));
  const VI span = hn::ConvertTo(di, hn::Mul(hn::ConvertTo(d, stretch), Number(1.0 / kStretchesPerSpan)));
  const VI place = hn::Add(hn::Add(stretch, stretch), hn::IfThenElseZero(is_near, hn::Set(di, 1)));
  const int whole_spans = choice.stretches / kStretchesPerSpan;
  const V spans = hn::Set(d, static_cast<float>(whole_spans));
  const V s = hn::Sub(hn::Min(begun, spans), hn::ConvertTo(d, span));
  const V weight = hn::Div(hn::Set(d, 1.0F), hn::Mul(sigma, sigma));
  const V x = hn::Mul(depth_m, direction_x), y = hn::Mul(depth_m, direction_y);
  if (hn::AllTrue(d, keep)) {  // as mostly
    hn::StoreU(hn::BitCast(du, place), du, chosen.place.data() + chosen.count);
    hn::StoreInterleaved4(x, y, depth_m, weight, d, &chosen.points[chosen.count].x);
    hn::StoreInterleaved4(direction_x, direction_y, hn::Set(d, 1.0F), s, d, &chosen.rays[chosen.count].x);
    chosen.count += hn::Lanes(d);
    return;
  }
  // One by one: Highway's Compress copies its table onto the stack for every call (GCC 12).
  std::uint32_t places[ChosenPixels::kSpare];
  float points[4 * ChosenPixels::kSpare], rays[4 * ChosenPixels::kSpare];
  hn::StoreU(hn::BitCast(du, place), du, places);
  hn::StoreInterleaved4(x, y, depth_m, weight, d, points);
  hn::StoreInterleaved4(direction_x, direction_y, hn::Set(d, 1.0F), s, d, rays);
  for (std::uint64_t bits = Bits(keep); bits != 0; bits &= bits - 1, ++chosen.count) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
    chosen.place[chosen.count] = places[lane];
    std::memcpy(&chosen.points[chosen.count].x, points + 4 * lane, 4 * sizeof(float));
    std::memcpy(&chosen.rays[chosen.count].x, rays + 4 * lane, 4 * sizeof(float));
  }
}

void ChoosePixels(const PixelChoice& choice, const PredictedPixels& pixels, ChosenPixels& chosen) {
  chosen.count = 0;
  for (std::size_t k = 0; k < pixels.rows.size(); ++k) {
    const std::size_t end = pixels.end_of_row(k);
    for (std::size_t i = pixels.rows[k]; i < end; i += hn::Lanes(D())) ChooseVector(choice, pixels, i, end, chosen);
  }
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
  // More than is asked for, as for predicted pixels: their number grows and shrinks.
  const std::size_t reserved = std::max(room, std::size_t{16384});
  place.reserve(reserved);
  points.reserve(reserved);
  rays.reserve(reserved);
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
