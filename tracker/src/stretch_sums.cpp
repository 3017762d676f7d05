#include "stretch_sums.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

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
  std::array<double, 3> c0, c1, c2, c3;  ///< place at s: c0 + s (c1 + s (c2 + s c3))
  double s_min, s_max;                   ///< the ends of the whole centreline
  double radius_m;
};

/// Partial sums over a stretch, in the order of StretchSums: always as many, whatever a vector of this machine holds,
/// so that the bytes are the same everywhere.
struct PartialSums {
  using Row = std::array<double, kPartials>;
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

using D = hn::CappedTag<double, kPartials>;
using V = hn::Vec<D>;

HWY_INLINE V Number(double value) {
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
  const V inner = hn::Add(Number(2.0 * span.c2[axis]), hn::Mul(s, Number(3.0 * span.c3[axis])));
  return hn::Add(Number(span.c1[axis]), hn::Mul(s, inner));
}

/// `residual_on`, step by step, for as many observations as a vector holds, and what they add to the sums.
HWY_INLINE void AddVector(const SpanOfTube& span, const ObservationBlock& block, std::size_t lane, PartialSums& sums) {
  const D d;
  const V one = Number(1.0);
  const V zero = hn::Zero(d);
  const V x = hn::LoadU(d, block.x.data() + lane);
  const V y = hn::LoadU(d, block.y.data() + lane);
  const V z = hn::LoadU(d, block.z.data() + lane);
  const V dx = hn::LoadU(d, block.direction_x.data() + lane);
  const V dy = hn::LoadU(d, block.direction_y.data() + lane);
  const V dz = hn::LoadU(d, block.direction_z.data() + lane);
  const V radius = Number(span.radius_m);
  V s = hn::LoadU(d, block.s.data() + lane);
  V off_x, off_y, off_z, ray_x, ray_y, ray_z, slope, shift;
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
    const V c = hn::Sub(Dot(off_x, off_y, off_z, off_x, off_y, off_z), hn::Mul(radius, radius));
    const V discriminant = hn::Sub(hn::Mul(b, b), hn::Mul(a, c));
    slope = hn::Neg(hn::Div(hn::Sqrt(hn::Max(discriminant, zero)), radius));
    valid = hn::And(hn::Ge(a, Number(1e-6)), hn::Le(slope, Number(-0.17)));
    shift = hn::Div(hn::Sub(hn::Mul(slope, radius), b), hn::Max(a, Number(1e-6)));
    const V off = hn::Add(point_along, hn::Mul(shift, ray_along));
    const V step = hn::Min(hn::Max(off, Number(-0.5)), Number(0.5));
    const V next = hn::Min(hn::Max(hn::Add(s, step), Number(span.s_min)), Number(span.s_max));
    const auto goes_on = hn::And(valid, hn::Ge(hn::Abs(hn::Sub(next, s)), Number(0.01)));
    if (hn::AllFalse(d, goes_on)) break;
    s = hn::IfThenElse(goes_on, next, s);
  }
  slope = hn::IfThenElse(valid, slope, Number(-1.0));
  const V per_length = hn::Div(one, hn::Mul(radius, slope));
  const V by_x = hn::Mul(hn::Add(off_x, hn::Mul(shift, ray_x)), per_length);
  const V by_y = hn::Mul(hn::Add(off_y, hn::Mul(shift, ray_y)), per_length);
  const V by_z = hn::Mul(hn::Add(off_z, hn::Mul(shift, ray_z)), per_length);
  const V by_radius = hn::Div(one, slope);
  const V residual = hn::Neg(shift);
  const V weight = hn::IfThenElseZero(valid, hn::LoadU(d, block.weight.data() + lane));
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

void AddBlocks(const SpanOfTube& span, const ObservationBlock* blocks, std::size_t count, PartialSums& sums) {
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t lane = 0; lane < kPartials; lane += hn::Lanes(D())) AddVector(span, blocks[i], lane, sums);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(AddBlocks);

namespace {

double sum(const PartialSums::Row& row) {
  return ((row[0] + row[1]) + (row[2] + row[3])) + ((row[4] + row[5]) + (row[6] + row[7]));
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

SpanOfTube span_of_tube(const SpanPolynomial& polynomial, std::size_t span, double spans, double radius_m) {
  const auto numbers = [](const Eigen::Vector3d& v) { return std::array<double, 3>{v.x(), v.y(), v.z()}; };
  const auto& [c0, c1, c2, c3] = polynomial;
  const auto start = static_cast<double>(span);
  return {numbers(c0), numbers(c1), numbers(c2), numbers(c3), -start, spans - start, radius_m};
}

void put(const Observation& observation, double s, double weight, std::size_t lane, ObservationBlock& block) {
  block.x[lane] = observation.point_m.x();
  block.y[lane] = observation.point_m.y();
  block.z[lane] = observation.point_m.z();
  block.direction_x[lane] = observation.direction.x();
  block.direction_y[lane] = observation.direction.y();
  block.direction_z[lane] = observation.direction.z();
  block.weight[lane] = weight;
  block.s[lane] = s;
}

}  // namespace

SortedObservations sort_by_stretch(std::span<const Observation> observations, std::size_t spans) {
  const std::size_t stretches = spans * kStretchesPerSpan;
  const auto t_max = static_cast<double>(spans);
  const auto stretch_of = [&](double t) {
    return std::min(static_cast<std::size_t>(std::max(t, 0.0) * kStretchesPerSpan), stretches - 1);
  };
  std::vector<std::size_t> count(stretches, 0);
  for (const Observation& observation : observations) ++count[stretch_of(observation.t)];
  SortedObservations sorted;
  sorted.first.assign(stretches + 1, 0);
  for (std::size_t k = 0; k < stretches; ++k) {
    sorted.first[k + 1] = sorted.first[k] + (count[k] + kPartials - 1) / kPartials;
    count[k] = 0;
  }
  sorted.blocks.resize(sorted.first.back());
  for (const Observation& observation : observations) {
    const std::size_t k = stretch_of(observation.t);
    const std::size_t n = count[k]++;
    const std::size_t span = k / kStretchesPerSpan;
    const double s = std::clamp(observation.t, 0.0, t_max) - static_cast<double>(span);
    ObservationBlock& block = sorted.blocks[sorted.first[k] + n / kPartials];
    put(observation, s, 1.0 / (observation.sigma_m * observation.sigma_m), n % kPartials, block);
    if (n % kPartials != 0) continue;
    for (std::size_t lane = 1; lane < kPartials; ++lane) put(observation, s, 0.0, lane, block);
  }
  return sorted;
}

std::vector<StretchSums> sum_stretches(const TubeModel& model, const SortedObservations& sorted) {
  const std::vector<SpanPolynomial> curve = polynomials_of(model.spline);
  const std::size_t stretches = curve.size() * kStretchesPerSpan;
  std::vector<StretchSums> sums(stretches);
  for (std::size_t k = 0; k < stretches; ++k) {
    const std::size_t count = sorted.first[k + 1] - sorted.first[k];
    if (count == 0) continue;
    const std::size_t span = k / kStretchesPerSpan;
    PartialSums partial{};
    const double radius_m = radius_at(model, (static_cast<double>(k) + 0.5) / kStretchesPerSpan);
    HWY_DYNAMIC_DISPATCH(AddBlocks)
    (span_of_tube(curve[span], span, static_cast<double>(curve.size()), radius_m),
     sorted.blocks.data() + sorted.first[k], count, partial);
    sums[k] = summed(partial);
  }
  return sums;
}

}  // namespace tubetrack
#endif
