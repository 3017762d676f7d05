#include "stretch_sums.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "tubetrack/tracker/recycled.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stretch_sums.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

#ifndef TUBETRACK_STRETCH_BLOCK
#define TUBETRACK_STRETCH_BLOCK
namespace tubetrack {

/// A span of the centreline and the tube's radius.
struct SpanOfTube {
  std::array<float, 3> c0, c1, c2, c3;  ///< place at s: c0 + s (c1 + s (c2 + s c3)), from the observations' origin
  float s_min, s_max;                   ///< the ends of the whole centreline
  float radius_m;
};

/// Partial sums over a stretch, in the order of StretchSums: always as many, whatever a vector of this machine holds,
/// so that the bytes are the same everywhere.
struct PartialSums {
  using Row = std::array<float, kPartials>;
  Row xx, xy, xz, yy, yz, zz;
  Row x_radius, y_radius, z_radius;
  Row x_residual, y_residual, z_residual;
  Row radius_radius, radius_residual, chi2, used;
};

}  // namespace tubetrack
#endif

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kPartials>;
using V = hn::Vec<D>;

HWY_INLINE V Number(float value) {
  return hn::Set(D(), value);
}

HWY_INLINE V Dot(V ax, V ay, V az, V bx, V by, V bz) {
  return hn::Add(hn::Add(hn::Mul(ax, bx), hn::Mul(ay, by)), hn::Mul(az, bz));
}

HWY_INLINE V Place(const SpanOfTube& span, std::size_t axis, V s) {
  const V inner = hn::Add(Number(span.c2[axis]), hn::Mul(s, Number(span.c3[axis])));
  return hn::Add(Number(span.c0[axis]), hn::Mul(s, hn::Add(Number(span.c1[axis]), hn::Mul(s, inner))));
}

HWY_INLINE V Slope(const SpanOfTube& span, std::size_t axis, V s) {
  const V inner = hn::Add(Number(2.0F * span.c2[axis]), hn::Mul(s, Number(3.0F * span.c3[axis])));
  return hn::Add(Number(span.c1[axis]), hn::Mul(s, inner));
}

/// `residual_on`, step by step, for as many observations as a vector holds, and what they add to the sums. Lengths
/// along a ray are in lengths of its direction, σ too, which leaves every sum what it is.
HWY_INLINE void AddVector(const SpanOfTube& span, const ObservedPoint* points, const ObservedRay* rays,
                          std::size_t lane, PartialSums& sums) {
  const D d;
  const V one = Number(1.0F);
  const V zero = hn::Zero(d);
  V x, y, z, given_weight, dx, dy, dz, s;
  hn::LoadInterleaved4(d, &points->x, x, y, z, given_weight);
  hn::LoadInterleaved4(d, &rays->x, dx, dy, dz, s);
  const V direction2 = Dot(dx, dy, dz, dx, dy, dz);
  const V radius2 = Number(span.radius_m * span.radius_m);
  const V least_a = hn::Mul(Number(1e-6F), direction2);
  const V least_root2 = hn::Mul(Number(0.17F * 0.17F * span.radius_m * span.radius_m), direction2);
  V off_x, off_y, off_z, ray_x, ray_y, ray_z, root2, root, shift;
  hn::Mask<D> valid;
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    const V from_x = hn::Sub(x, Place(span, 0, s));
    const V from_y = hn::Sub(y, Place(span, 1, s));
    const V from_z = hn::Sub(z, Place(span, 2, s));
    const V along_x = Slope(span, 0, s);
    const V along_y = Slope(span, 1, s);
    const V along_z = Slope(span, 2, s);
    const V per_speed2 = hn::Div(one, Dot(along_x, along_y, along_z, along_x, along_y, along_z));
    const V point_along = hn::Mul(Dot(from_x, from_y, from_z, along_x, along_y, along_z), per_speed2);
    const V ray_along = hn::Mul(Dot(dx, dy, dz, along_x, along_y, along_z), per_speed2);
    off_x = hn::Sub(from_x, hn::Mul(point_along, along_x));
    off_y = hn::Sub(from_y, hn::Mul(point_along, along_y));
    off_z = hn::Sub(from_z, hn::Mul(point_along, along_z));
    ray_x = hn::Sub(dx, hn::Mul(ray_along, along_x));
    ray_y = hn::Sub(dy, hn::Mul(ray_along, along_y));
    ray_z = hn::Sub(dz, hn::Mul(ray_along, along_z));
    const V a = Dot(ray_x, ray_y, ray_z, ray_x, ray_y, ray_z);
    const V b = Dot(ray_x, ray_y, ray_z, off_x, off_y, off_z);
    const V c = hn::Sub(Dot(off_x, off_y, off_z, off_x, off_y, off_z), radius2);
    root2 = hn::Sub(hn::Mul(b, b), hn::Mul(a, c));
    root = hn::Sqrt(hn::Max(root2, zero));
    valid = hn::And(hn::Ge(a, least_a), hn::Ge(root2, least_root2));
    shift = hn::Neg(hn::Div(hn::Add(b, root), hn::Max(a, least_a)));
    const V off = hn::Add(point_along, hn::Mul(shift, ray_along));
    const V step = hn::Min(hn::Max(off, Number(-0.5F)), Number(0.5F));
    const V next = hn::Min(hn::Max(hn::Add(s, step), Number(span.s_min)), Number(span.s_max));
    const auto goes_on = hn::And(valid, hn::Ge(hn::Abs(hn::Sub(next, s)), Number(0.01F)));
    if (hn::AllFalse(d, goes_on)) break;
    s = hn::IfThenElse(goes_on, next, s);
  }
  const V per_slope = hn::Neg(hn::Div(one, hn::IfThenElse(valid, root, one)));
  const V by_x = hn::Mul(hn::Add(off_x, hn::Mul(shift, ray_x)), per_slope);
  const V by_y = hn::Mul(hn::Add(off_y, hn::Mul(shift, ray_y)), per_slope);
  const V by_z = hn::Mul(hn::Add(off_z, hn::Mul(shift, ray_z)), per_slope);
  const V by_radius = hn::Mul(Number(span.radius_m), per_slope);
  const V residual = hn::Neg(shift);
  const V weight = hn::IfThenElseZero(valid, given_weight);
  const V weighted_x = hn::Mul(weight, by_x);
  const V weighted_y = hn::Mul(weight, by_y);
  const V weighted_z = hn::Mul(weight, by_z);
  const V weighted_radius = hn::Mul(weight, by_radius);
  const V weighted_residual = hn::Mul(weight, residual);
  const auto add = [&](PartialSums::Row& row, V value)
                       HWY_ATTR { hn::StoreU(hn::Add(hn::LoadU(d, row.data() + lane), value), d, row.data() + lane); };
  add(sums.xx, hn::Mul(weighted_x, by_x));
  add(sums.xy, hn::Mul(weighted_x, by_y));
  add(sums.xz, hn::Mul(weighted_x, by_z));
  add(sums.yy, hn::Mul(weighted_y, by_y));
  add(sums.yz, hn::Mul(weighted_y, by_z));
  add(sums.zz, hn::Mul(weighted_z, by_z));
  add(sums.x_radius, hn::Mul(weighted_x, by_radius));
  add(sums.y_radius, hn::Mul(weighted_y, by_radius));
  add(sums.z_radius, hn::Mul(weighted_z, by_radius));
  add(sums.x_residual, hn::Mul(weighted_x, residual));
  add(sums.y_residual, hn::Mul(weighted_y, residual));
  add(sums.z_residual, hn::Mul(weighted_z, residual));
  add(sums.radius_radius, hn::Mul(weighted_radius, by_radius));
  add(sums.radius_residual, hn::Mul(weighted_radius, residual));
  add(sums.chi2, hn::Mul(weighted_residual, residual));
  add(sums.used, hn::IfThenElseZero(hn::Gt(weight, zero), one));
}

void AddObserved(const SpanOfTube& span, const ObservedPoint* points, const ObservedRay* rays, std::size_t count,
                 PartialSums& sums) {
  for (std::size_t i = 0; i < count; i += hn::Lanes(D())) AddVector(span, points + i, rays + i, i % kPartials, sums);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(AddObserved);

namespace {

double sum(const PartialSums::Row& row) {
  const std::array<double, kPartials> r{row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7]};
  return ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));
}

StretchSums summed(const PartialSums& p) {
  StretchSums sums;
  sums.point_point << sum(p.xx), sum(p.xy), sum(p.xz), sum(p.xy), sum(p.yy), sum(p.yz), sum(p.xz), sum(p.yz), sum(p.zz);
  sums.point_radius << sum(p.x_radius), sum(p.y_radius), sum(p.z_radius);
  sums.point_residual << sum(p.x_residual), sum(p.y_residual), sum(p.z_residual);
  sums.radius_radius = sum(p.radius_radius);
  sums.radius_residual = sum(p.radius_residual);
  sums.chi2 = sum(p.chi2);
  sums.used = static_cast<int>(sum(p.used));
  return sums;
}

SpanOfTube span_of_tube(const SpanPolynomial& polynomial, const Eigen::Vector3d& origin_m, std::size_t span,
                        std::size_t spans, double radius_m) {
  const auto numbers = [](const Eigen::Vector3d& v) {
    return std::array<float, 3>{static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
  };
  const auto& [c0, c1, c2, c3] = polynomial;
  const auto start = static_cast<float>(span);
  return {numbers(c0 - origin_m),      numbers(c1), numbers(c2), numbers(c3), -start, static_cast<float>(spans) - start,
          static_cast<float>(radius_m)};
}

}  // namespace

void make_room(const Spline& spline, RecycledVector<std::size_t>& count, SortedObservations& sorted) {
  const std::size_t spans = spline.control_m.size() - 3;
  sorted.origin_m.resize(spans);
  for (std::size_t k = 0; k < spans; ++k) sorted.origin_m[k] = point_at(spline, static_cast<double>(k));
  sorted.first.resize(count.size() + 1);
  std::size_t room = 0;
  sorted.count = 0;
  for (std::size_t k = 0; k < count.size(); ++k) {
    sorted.first[k] = room;
    sorted.count += count[k];
    room += (count[k] + kPartials - 1) / kPartials * kPartials;
  }
  sorted.first.back() = room;
  if (sorted.points.size() < room) {
    // The next frame may see a little more.
    const auto widen = [room](auto& column) {
      if (column.capacity() < room) column.reserve(room + room / 2);
      column.resize(room);
    };
    widen(sorted.points);
    widen(sorted.rays);
  }
  const Eigen::Vector3f ahead = Eigen::Vector3f::UnitZ();
  for (std::size_t k = 0; k < count.size(); ++k) {
    const std::size_t begin = sorted.first[k];
    for (std::size_t at = begin + count[k]; at < sorted.first[k + 1]; ++at)
      put(Eigen::Vector3f::Zero(), ahead, 0.0F, 0.0F, at, sorted);
    count[k] = begin;
  }
}

SortedObservations sort_by_stretch(std::span<const Observation> observations, const Spline& spline) {
  const std::size_t stretches = (spline.control_m.size() - 3) * kStretchesPerSpan;
  RecycledVector<std::size_t> next(stretches, 0);
  for (const Observation& observation : observations) ++next[stretch_of(observation.t, stretches)];
  SortedObservations sorted;
  make_room(spline, next, sorted);
  for (const Observation& observation : observations) {
    const std::size_t k = stretch_of(observation.t, stretches);
    const std::size_t span = k / kStretchesPerSpan;
    const Eigen::Vector3d from_origin_m = observation.point_m - sorted.origin_m[span];
    const double weight = 1.0 / (observation.sigma_m * observation.sigma_m);
    const double s = std::clamp(observation.t, 0.0, spline.spans()) - static_cast<double>(span);
    put(from_origin_m.cast<float>(), observation.direction.cast<float>(), static_cast<float>(weight),
        static_cast<float>(s), next[k]++, sorted);
  }
  return sorted;
}

RecycledVector<StretchSums> sum_stretches(const TubeModel& model, const SortedObservations& sorted) {
  const RecycledVector<SpanPolynomial> curve = polynomials_of(model.spline);
  const std::size_t stretches = curve.size() * kStretchesPerSpan;
  RecycledVector<StretchSums> sums(stretches);
  for (std::size_t k = 0; k < stretches; ++k) {
    const std::size_t count = sorted.first[k + 1] - sorted.first[k];
    if (count == 0) continue;
    const std::size_t span = k / kStretchesPerSpan;
    PartialSums partial{};
    const double radius_m = radius_at(model, (static_cast<double>(k) + 0.5) / kStretchesPerSpan);
    HWY_DYNAMIC_DISPATCH(AddObserved)
    (span_of_tube(curve[span], sorted.origin_m[span], span, curve.size(), radius_m),
     sorted.points.data() + sorted.first[k], sorted.rays.data() + sorted.first[k], count, partial);
    sums[k] = summed(partial);
  }
  return sums;
}

}  // namespace tubetrack
#endif
