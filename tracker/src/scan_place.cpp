#include "scan_place.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "tubetrack/tracker/recycled.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scan_place.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kMostLanes = 16;
static_assert(PlaceBatch::kSize % kMostLanes == 0 && NearestBatch::kSize % kMostLanes == 0);
using D = hn::CappedTag<float, kMostLanes>;
using DI = hn::RebindToSigned<D>;
using V = hn::Vec<D>;
using VI = hn::Vec<DI>;

constexpr int kSurfelFloats = sizeof(CellSurfel) / sizeof(float);
constexpr int kSpanFloats = sizeof(LineSpan) / sizeof(float);

HWY_INLINE V Number(float value) {
  return hn::Set(D(), value);
}

HWY_INLINE VI Whole(int value) {
  return hn::Set(DI(), value);
}

struct V3 {
  V x, y, z;
};

HWY_INLINE V3 Gather3(const float* first, VI at) {
  const D d;
  return {hn::GatherIndex(d, first, at), hn::GatherIndex(d, first + 1, at), hn::GatherIndex(d, first + 2, at)};
}

HWY_INLINE V3 Sub3(const V3& a, const V3& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

HWY_INLINE V3 Scaled(V by, const V3& a) {
  return {hn::Mul(by, a.x), hn::Mul(by, a.y), hn::Mul(by, a.z)};
}

/// a + by · b
HWY_INLINE V3 Sum3(const V3& a, V by, const V3& b) {
  return {hn::Add(a.x, hn::Mul(by, b.x)), hn::Add(a.y, hn::Mul(by, b.y)), hn::Add(a.z, hn::Mul(by, b.z))};
}

HWY_INLINE V Dot(const V3& a, const V3& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}

HWY_INLINE V3 Cross(const V3& a, const V3& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}

HWY_INLINE V Clamp(V value, V low, V high) {
  return hn::Min(hn::Max(value, low), high);
}

/// A surfel's foot on the line.
struct Foot {
  VI span;
  V s;
  V3 from_foot;  ///< to the surfel
  V3 derivative, second;
  V speed2;
};

HWY_INLINE void Evaluate(const float* line, const V3& point, Foot& foot) {
  const VI at = hn::Mul(foot.span, Whole(kSpanFloats));
  const V3 c1 = Gather3(line + 6, at), c2 = Gather3(line + 9, at), c3 = Gather3(line + 12, at);
  const V3 from_start = Sub3(Sub3(point, Gather3(line, at)), Gather3(line + 3, at));
  const V s = foot.s;
  foot.from_foot = Sub3(from_start, Scaled(s, Sum3(c1, s, Sum3(c2, s, c3))));
  foot.derivative = Sum3(c1, s, Sum3(Scaled(Number(2.0F), c2), hn::Mul(Number(3.0F), s), c3));
  foot.second = Sum3(Scaled(Number(2.0F), c2), hn::Mul(Number(6.0F), s), c3);
  foot.speed2 = hn::Max(Dot(foot.derivative, foot.derivative), Number(1e-30F));
}

/// Steps along the line until they are small; each lane for itself, so that it does not matter which are together.
HWY_INLINE void FindFoot(const float* line, int last_span, const V3& point, Foot& foot) {
  const D d;
  const V zero = hn::Zero(d), one = Number(1.0F);
  constexpr int kRounds = 3;
  for (int round = 0;; ++round) {
    Evaluate(line, point, foot);
    if (round == kRounds) return;
    const V step = Clamp(hn::Div(Dot(foot.from_foot, foot.derivative), foot.speed2), Number(-0.5F), Number(0.5F));
    const auto at_first = hn::RebindMask(d, hn::Eq(foot.span, Whole(0)));
    const auto at_last = hn::RebindMask(d, hn::Eq(foot.span, Whole(last_span)));
    const V next = Clamp(hn::Add(foot.s, step), hn::IfThenElse(at_first, zero, Number(-1.0F)),
                         hn::IfThenElse(at_last, one, Number(2.0F)));
    const auto goes_on = hn::Ge(hn::Abs(hn::Sub(next, foot.s)), Number(0.01F));
    if (hn::AllFalse(d, goes_on)) return;
    const auto down = hn::Lt(next, zero), up = hn::AndNot(at_last, hn::Ge(next, one));
    const V in_span = hn::IfThenElse(down, hn::Add(next, one), hn::IfThenElse(up, hn::Sub(next, one), next));
    const VI by = hn::Sub(hn::IfThenElseZero(hn::RebindMask(DI(), up), Whole(1)),
                          hn::IfThenElseZero(hn::RebindMask(DI(), down), Whole(1)));
    foot.s = hn::IfThenElse(goes_on, in_span, foot.s);
    foot.span = hn::Add(foot.span, hn::IfThenElseZero(hn::RebindMask(DI(), goes_on), by));
  }
}

/// A spread's mean square along an axis.
HWY_INLINE V MeanSquare(const V3& xx_xy_xz, const V3& yy_yz_zz, const V3& axis) {
  const V3 first{xx_xy_xz.x, hn::Add(xx_xy_xz.y, xx_xy_xz.y), hn::Add(xx_xy_xz.z, xx_xy_xz.z)};
  const V of_y = hn::Add(hn::Mul(yy_yz_zz.x, axis.y), hn::Mul(hn::Add(yy_yz_zz.y, yy_yz_zz.y), axis.z));
  return hn::Add(hn::Add(hn::Mul(axis.x, Dot(first, axis)), hn::Mul(axis.y, of_y)),
                 hn::Mul(hn::Mul(yy_yz_zz.z, axis.z), axis.z));
}

constexpr float kNearestRadii = 0.5F;
constexpr float kLeastFacing = 0.5F;  // 60°
constexpr float kMostAlong = 0.4F;    // 24°
constexpr float kMostBeyond = 0.1F;   // beyond an end the foot stays there

void PlaceSurfels(const float* line, int last_span, float radius_m, const float* surfels, std::size_t count,
                  PlaceBatch& batch) {
  const D d;
  const DI di;
  const V one = Number(1.0F), radius = Number(radius_m), half = Number(0.5F);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const VI at = hn::Mul(hn::Load(di, batch.surfel.data() + i), Whole(kSurfelFloats));
    const V3 point = Gather3(surfels, at), normal = Gather3(surfels + 3, at);
    Foot foot{};
    foot.span = hn::Load(di, batch.span.data() + i);
    foot.s = hn::Load(d, batch.s.data() + i);
    FindFoot(line, last_span, point, foot);
    const V distance = hn::Sqrt(Dot(foot.from_foot, foot.from_foot));
    const V per_distance = hn::Div(Number(-1.0F), hn::Max(distance, Number(1e-30F)));
    const V3 inward = Scaled(per_distance, foot.from_foot);
    const V3 along = Scaled(hn::Div(one, hn::Sqrt(foot.speed2)), foot.derivative);
    auto belongs = hn::And(hn::Ge(distance, hn::Mul(Number(kNearestRadii), radius)),
                           hn::Le(distance, hn::Mul(Number(static_cast<float>(kFarthestRadii)), radius)));
    belongs = hn::And(belongs, hn::Le(hn::Abs(Dot(inward, along)), Number(kMostBeyond)));
    belongs = hn::And(belongs, hn::Ge(Dot(inward, normal), Number(kLeastFacing)));
    belongs = hn::And(belongs, hn::Le(hn::Abs(Dot(along, normal)), Number(kMostAlong)));
    // The mean of points of a curved surface lies below it, by half of its curvature times their mean square along it.
    // Around, a tube's curvature is 1/R; along, in a bend, it is that of the circle that the surface follows there.
    const V3 spread_x = Gather3(surfels + 7, at), spread_yz = Gather3(surfels + 10, at);
    const V to_bend = hn::Div(Dot(inward, foot.second), foot.speed2);
    const V bent = hn::Div(to_bend, hn::Max(Number(0.2F), hn::Add(one, hn::Mul(radius, to_bend))));
    const V around = hn::Div(MeanSquare(spread_x, spread_yz, Cross(along, inward)), radius);
    const V lift = hn::Mul(half, hn::Add(around, hn::Mul(MeanSquare(spread_x, spread_yz, along), bent)));
    hn::Store(foot.span, di, batch.span.data() + i);
    hn::Store(hn::IfThenElseZero(hn::RebindMask(di, belongs), Whole(1)), di, batch.belongs.data() + i);
    hn::Store(foot.s, d, batch.s.data() + i);
    hn::Store(lift, d, batch.lift_m.data() + i);
    hn::Store(hn::Add(distance, lift), d, batch.distance_m.data() + i);
    hn::Store(inward.x, d, batch.x.data() + i);
    hn::Store(inward.y, d, batch.y.data() + i);
    hn::Store(inward.z, d, batch.z.data() + i);
  }
}

void NearestNodes(std::span<const std::array<float, 3>> nodes_m, const std::array<float, 3>& origin_m,
                  const float* surfels, std::size_t count, NearestBatch& batch) {
  const D d;
  const DI di;
  const V3 origin{Number(origin_m[0]), Number(origin_m[1]), Number(origin_m[2])};
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const VI at = hn::Mul(hn::Load(di, batch.surfel.data() + i), Whole(kSurfelFloats));
    const V3 point = Sub3(Gather3(surfels, at), origin);
    V least = Number(1e30F);
    VI nearest = Whole(0);
    for (std::size_t node = 0; node < nodes_m.size(); ++node) {
      const auto& [x, y, z] = nodes_m[node];
      const V3 way = Sub3(point, {Number(x), Number(y), Number(z)});
      const V squared = Dot(way, way);
      const auto nearer = hn::Lt(squared, least);
      least = hn::IfThenElse(nearer, squared, least);
      nearest = hn::IfThenElse(hn::RebindMask(di, nearer), Whole(static_cast<int>(node)), nearest);
    }
    hn::Store(nearest, di, batch.nearest.data() + i);
    hn::Store(least, d, batch.squared_m2.data() + i);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(PlaceSurfels);
HWY_EXPORT(NearestNodes);

static_assert(sizeof(CellSurfel) == 13 * sizeof(float) && sizeof(LineSpan) == 15 * sizeof(float));

std::vector<LineSpan> line_spans_of(const Spline& spline) {
  std::vector<LineSpan> spans;
  const auto numbers = [](const Eigen::Vector3d& v) {
    return std::array<float, 3>{static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
  };
  for (const auto& [c0, c1, c2, c3] : polynomials_of(spline)) {
    const Eigen::Vector3d rest = c0 - c0.cast<float>().cast<double>();
    spans.push_back({numbers(c0), numbers(rest), numbers(c1), numbers(c2), numbers(c3)});
  }
  return spans;
}

void place_surfels(std::span<const LineSpan> line, double radius_m, std::span<const CellSurfel> surfels,
                   std::size_t count, PlaceBatch& batch) {
  if (count == 0) return;
  std::fill(batch.surfel.begin() + static_cast<std::ptrdiff_t>(count), batch.surfel.end(), batch.surfel.front());
  std::fill(batch.span.begin() + static_cast<std::ptrdiff_t>(count), batch.span.end(), batch.span.front());
  std::fill(batch.s.begin() + static_cast<std::ptrdiff_t>(count), batch.s.end(), batch.s.front());
  HWY_DYNAMIC_DISPATCH(PlaceSurfels)
  (line.front().c0.data(), static_cast<int>(line.size()) - 1, static_cast<float>(radius_m),
   surfels.front().position_m.data(), count, batch);
}

void nearest_nodes(std::span<const std::array<float, 3>> nodes_m, const std::array<float, 3>& origin_m,
                   std::span<const CellSurfel> surfels, std::size_t count, NearestBatch& batch) {
  if (count == 0) return;
  std::fill(batch.surfel.begin() + static_cast<std::ptrdiff_t>(count), batch.surfel.end(), batch.surfel.front());
  HWY_DYNAMIC_DISPATCH(NearestNodes)(nodes_m, origin_m, surfels.front().position_m.data(), count, batch);
}

}  // namespace tubetrack
#endif
