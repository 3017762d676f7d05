#include "surfel_row.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#ifndef TUBETRACK_SURFEL_BAND
#define TUBETRACK_SURFEL_BAND
namespace tubetrack {
namespace {
// The band of radii that a curvature k allows: from kLowShare / (k + kBandSigmas σ) on.
constexpr float kBandSigmas = 2.0F;
constexpr float kLowShare = 0.8F;
}  // namespace
}  // namespace tubetrack
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "surfel_row.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

#include "beside-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

/// What stands at some places, each lane at its own.
HWY_INLINE V At(const float* from, VI places) {
  return hn::GatherIndex(D(), from, places);
}

HWY_INLINE VI Beside(VI places, int by) {
  return hn::Add(places, hn::Set(DI(), by));
}

struct V3 {
  V x, y, z;
};

HWY_INLINE V3 Sub(const V3& a, const V3& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

HWY_INLINE V3 Scale(const V3& a, V s) {
  return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)};
}

HWY_INLINE V Dot(const V3& a, const V3& b) {
  return hn::Add(hn::Mul(a.x, b.x), hn::Add(hn::Mul(a.y, b.y), hn::Mul(a.z, b.z)));
}

HWY_INLINE V3 Cross(const V3& a, const V3& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}

HWY_INLINE V3 Select(M mask, const V3& yes, const V3& no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y), hn::IfThenElse(mask, yes.z, no.z)};
}

struct Facet {
  V slope_u, slope_v;  ///< per pixel; huge where there is no plane
  V3 position_m;
  V3 normal;
  V norm;        ///< of (a, b, c), one over the plane's distance
  V px_per_ray;  ///< the larger of both axes
};

/// Rays of a vector of cells, and the slopes there: per pixel at first, then per unit of ray.
struct Rays {
  V x, y;
  V slope_x, slope_y;
  V px_per_ray;
};

HWY_INLINE Rays RaysWithoutDistortion(const SurfelRule& rule, V u, int v, V slope_u, V slope_v) {
  const V x = hn::Sub(u, Set(rule.cx_px));
  return {hn::Mul(x, Set(1.0F / rule.fx_px)), Set((static_cast<float>(v) - rule.cy_px) * (1.0F / rule.fy_px)),
          hn::Mul(slope_u, Set(rule.fx_px)), hn::Mul(slope_v, Set(rule.fy_px)), Set(std::max(rule.fx_px, rule.fy_px))};
}

HWY_INLINE Rays RaysOfTable(const float* x, const float* y, std::ptrdiff_t stride, VI places, V slope_u, V slope_v) {
  const auto half_step = [&](const float* from, std::ptrdiff_t by) HWY_ATTR {
    return hn::Mul(Set(0.5F), hn::Sub(At(from + by, places), At(from - by, places)));
  };
  const V xu = half_step(x, 1);
  const V xv = half_step(x, stride);
  const V yu = half_step(y, 1);
  const V yv = half_step(y, stride);
  const V det = hn::Sub(hn::Mul(xu, yv), hn::Mul(xv, yu));
  const V per_px2 = hn::Min(hn::Add(hn::Mul(xu, xu), hn::Mul(xv, xv)), hn::Add(hn::Mul(yu, yu), hn::Mul(yv, yv)));
  return {At(x, places), At(y, places), hn::Div(hn::Sub(hn::Mul(slope_u, yv), hn::Mul(slope_v, yu)), det),
          hn::Div(hn::Sub(hn::Mul(slope_v, xu), hn::Mul(slope_u, xv)), det), hn::Div(Set(1.0F), hn::Sqrt(per_px2))};
}

/// The planes of `row`, which is `rows_down` below the neighbourhood's, at some places of it.
HWY_INLINE Facet FacetAt(const SurfelRule& rule, const Neighbourhood& n, const PlaneRow& row, VI places,
                         int rows_down) {
  const V slope_u = At(row.slope_u, places);
  const V slope_v = At(row.slope_v, places);
  const std::ptrdiff_t down = rows_down * n.ray_stride;
  const V u = hn::ConvertTo(D(), Beside(places, n.u_begin));
  const Rays r = rule.distorted ? RaysOfTable(n.ray_x + down, n.ray_y + down, n.ray_stride, places, slope_u, slope_v)
                                : RaysWithoutDistortion(rule, u, n.v + rows_down, slope_u, slope_v);
  const V a = r.slope_x;
  const V b = r.slope_y;
  const V w = At(row.height, places);
  const V c = hn::Sub(w, hn::Add(hn::Mul(a, r.x), hn::Mul(b, r.y)));
  const V norm = hn::Sqrt(hn::Add(hn::Mul(a, a), hn::Add(hn::Mul(b, b), hn::Mul(c, c))));
  const V one = Set(1.0F);
  const V z = hn::Div(one, w);
  return {slope_u, slope_v,     {hn::Mul(r.x, z), hn::Mul(r.y, z), z}, Scale({a, b, c}, hn::Div(one, norm)),
          norm,    r.px_per_ray};
}

/// Greater curvature (1/m, convex towards the camera positive) and its σ, from how the normal turns between the planes
/// to either side; and the σ if this is a plane.
struct Curvature {
  M known;
  V greater_per_m;
  V sigma_per_m;
  V flat_sigma_per_m;
};

/// |slope|² per pixel.
HWY_INLINE V Steepness2(const Facet& facet) {
  return hn::Add(hn::Mul(facet.slope_u, facet.slope_u), hn::Mul(facet.slope_v, facet.slope_v));
}

/// A plane and those half a window to either side of it.
struct Facets {
  Facet middle, before, after, above, below;
};

/// σ of a slope, per pixel, if all this is a plane: what depths jitter, and on a slope also what readings jitter
/// sideways. A plane is as steep everywhere, so the flattest of the windows counts: of what may be a tube that leaves
/// its flanks a vote. The second part is one frame's, however many were fused: it averages out as well, but the levels
/// that a sensor rounds to stay, and on a slope they bend.
HWY_INLINE V FlatSlopeSigma(const SurfelRule& rule, const Facets& facets, V axial, int half) {
  const float side = static_cast<float>(2 * half + 1);
  const float moment_px2 = side * side * static_cast<float>(half * (half + 1)) / 3.0F;
  const V across = hn::Min(Steepness2(facets.before), Steepness2(facets.after));
  const V down = hn::Min(Steepness2(facets.above), Steepness2(facets.below));
  const V steep = hn::Min(Steepness2(facets.middle), hn::Min(across, down));
  const V sideways = hn::Mul(steep, Set(rule.lateral_px * rule.lateral_px / moment_px2));
  return hn::Sqrt(hn::Add(hn::Mul(axial, axial), sideways));
}

HWY_INLINE Curvature CurvatureOf(const SurfelRule& rule, const Neighbourhood& n, VI places, const Facet& middle) {
  const int h = n.half;
  const Facets facets{middle, FacetAt(rule, n, n.row, Beside(places, -h), 0),
                      FacetAt(rule, n, n.row, Beside(places, h), 0), FacetAt(rule, n, n.above, places, -h),
                      FacetAt(rule, n, n.below, places, h)};
  const auto& [self, before, after, above, below] = facets;
  const Between across = Spread(before.slope_u, after.slope_u, h);
  const Between down = Spread(above.slope_u, below.slope_u, h);
  const auto step = [&](const Between& known, const V3& first, const V3& mid, const V3& second)
                        HWY_ATTR { return Sub(Select(known.after, second, mid), Select(known.before, first, mid)); };
  const V3 step_u = step(across, before.position_m, middle.position_m, after.position_m);
  const V3 turn_u = step(across, before.normal, middle.normal, after.normal);
  const V3 step_v = step(down, above.position_m, middle.position_m, below.position_m);
  const V3 turn_v = step(down, above.normal, middle.normal, below.normal);
  // In the tangent plane, the first axis along the step across.
  const V out_of_plane = Dot(middle.normal, step_u);
  const V3 flat = Sub(step_u, Scale(middle.normal, out_of_plane));
  const V length_u = hn::Sqrt(Dot(flat, flat));
  const V3 e1 = Scale(flat, hn::Div(Set(1.0F), length_u));
  const V3 e2 = Cross(middle.normal, e1);
  const V s01 = Dot(e1, step_v);
  const V s11 = Dot(e2, step_v);
  const V length_v = hn::Sqrt(hn::Add(hn::Mul(s01, s01), hn::Mul(s11, s11)));
  const V det = hn::Mul(length_u, s11);
  const M known = hn::Ge(hn::Abs(det), hn::Mul(Set(1e-3F), hn::Mul(length_u, length_v)));
  // Inward normals of a convex surface converge, so the shape operator is the negative of turns × steps⁻¹.
  const V inverse = hn::Div(Set(-1.0F), det);
  const auto row_of_shape = [&](const V3& e, V& first, V& second) HWY_ATTR {
    const V t0 = Dot(e, turn_u);
    const V t1 = Dot(e, turn_v);
    first = hn::Mul(hn::Mul(t0, s11), inverse);
    second = hn::Mul(hn::Sub(hn::Mul(t1, length_u), hn::Mul(t0, s01)), inverse);
  };
  V k00, k01, k10, k11;
  row_of_shape(e1, k00, k01);
  row_of_shape(e2, k10, k11);
  const V half = Set(0.5F);
  const V mean = hn::Mul(half, hn::Add(k00, k11));
  const V off = hn::Mul(half, hn::Add(k01, k10));
  const V side = hn::Mul(half, hn::Sub(k00, k11));
  const V spread = hn::Sqrt(hn::Add(hn::Mul(side, side), hn::Mul(off, off)));
  const V per_slope =
      hn::Div(hn::Mul(middle.px_per_ray, Set(kRoot2)), hn::Mul(middle.norm, hn::Min(length_u, length_v)));
  const V slope_sigma = At(n.row.slope_sigma, places);
  return {known, hn::Add(mean, spread), hn::Mul(slope_sigma, per_slope),
          hn::Mul(FlatSlopeSigma(rule, facets, slope_sigma, h), per_slope)};
}

/// The lanes of surfels, on their way from vectors to structs.
struct Lanes {
  alignas(64) float x[16], y[16], z[16], nx[16], ny[16], nz[16], sigma[16], low[16], high[16];

  /// Lane i is that of column `u_begin` + `places`[i].
  void write(std::uint64_t bits, int u_begin, const std::int32_t* places, std::uint64_t* found,
             FoundSurfel* out) const {
    for (; bits != 0; bits &= bits - 1) {
      const int i = std::countr_zero(bits);
      const int u = u_begin + places[i];
      found[(u + kMargin_px) / 64] |= std::uint64_t{1} << ((u + kMargin_px) % 64);
      out[u] = {u, x[i], y[i], z[i], nx[i], ny[i], nz[i], sigma[i], low[i], high[i]};
    }
  }
};

/// The careful gate on cells that bend down. Bits of the lanes that are surfels, their values in `lanes`.
std::uint64_t Surfels(const SurfelRule& rule, const Neighbourhood& n, VI places, Lanes& lanes) {
  const D d;
  const Facet middle = FacetAt(rule, n, n.row, places, 0);
  const Curvature k = CurvatureOf(rule, n, places, middle);
  const V z = middle.position_m.z;
  const V half_m = hn::Mul(z, Set(static_cast<float>(n.half) / rule.fx_px));
  const V two_sigma = hn::Mul(Set(kBandSigmas), k.sigma_per_m);
  const V low = hn::Div(Set(kLowShare), hn::Add(k.greater_per_m, two_sigma));
  const V high = hn::Div(Set(1.25F), hn::Sub(k.greater_per_m, two_sigma));
  M good = hn::And(k.known, hn::Ge(k.greater_per_m, hn::Mul(Set(rule.gate_sigmas), k.flat_sigma_per_m)));
  good = hn::And(good, hn::Le(hn::Mul(k.greater_per_m, half_m), Set(0.8F)));  // no wider than the tube it suggests
  good = hn::And(good, hn::And(hn::Ge(high, Set(rule.radius_min_m)), hn::Le(low, Set(rule.radius_max_m))));
  const std::uint64_t bits = Bits(good);
  if (bits == 0) return 0;
  const V off = hn::Sub(z, Set(rule.noise.reference_m));
  const V gauss = hn::Add(Set(rule.noise.constant_m), hn::Mul(Set(rule.noise.quadratic_per_m), hn::Mul(off, off)));
  const V z2 = hn::Mul(z, z);
  const V rounding = hn::Mul(hn::Mul(z2, z2), Set(rule.noise.rounding_variance_per_m2));
  hn::StoreU(middle.position_m.x, d, lanes.x);
  hn::StoreU(middle.position_m.y, d, lanes.y);
  hn::StoreU(z, d, lanes.z);
  hn::StoreU(middle.normal.x, d, lanes.nx);
  hn::StoreU(middle.normal.y, d, lanes.ny);
  hn::StoreU(middle.normal.z, d, lanes.nz);
  hn::StoreU(hn::Sqrt(hn::Add(hn::Mul(gauss, gauss), rounding)), d, lanes.sigma);
  hn::StoreU(hn::Max(low, Set(rule.radius_min_m)), d, lanes.low);
  hn::StoreU(hn::Min(high, Set(rule.radius_max_m)), d, lanes.high);
  return bits;
}

/// `candidates` has room for a vector more.
void SurfelsAt(const SurfelRule& rule, const Neighbourhood& n, std::int32_t* candidates, int count,
               std::uint64_t* found, FoundSurfel* out) {
  const int step = static_cast<int>(hn::Lanes(D()));
  std::fill_n(candidates + count, step, candidates[count - 1]);
  Lanes lanes;
  for (int i = 0; i < count; i += step) {
    const std::uint64_t wanted = (std::uint64_t{1} << std::min(step, count - i)) - 1;
    const std::uint64_t bits = Surfels(rule, n, hn::LoadU(DI(), candidates + i), lanes) & wanted;
    lanes.write(bits, n.u_begin, candidates + i, found, out);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(SurfelsAt);

SurfelRule::SurfelRule(const Intrinsics& in, float longest_ray2, const NoiseModel& model, const SurfelOptions& options)
    : noise(model),
      fx_px(static_cast<float>(in.fx_px)),
      fy_px(static_cast<float>(in.fy_px)),
      cx_px(static_cast<float>(in.cx_px)),
      cy_px(static_cast<float>(in.cy_px)),
      distorted(in.has_distortion()),
      lateral_px(static_cast<float>(model.lateral_px)),
      gate_sigmas(static_cast<float>(options.gate_sigmas)),
      screen_sigmas(gate_sigmas / std::sqrt(1.0F + longest_ray2)),
      radius_min_m(static_cast<float>(options.radius_min_m)),
      radius_max_m(static_cast<float>(options.radius_max_m)) {
  if (distorted) return;
  // The band's lower end is at most the largest radius, and the curvature's σ at most its share of the gate.
  const float least_per_m = kLowShare / (radius_max_m * (1.0F + kBandSigmas / gate_sigmas));
  constexpr float kCaution = 0.8F;  // differences over a window are not quite derivatives
  const float ray2 = 1.0F + longest_ray2;
  screen_bend_per_m = kCaution * least_per_m / (fx_px * fx_px * ray2 * std::sqrt(ray2));
}

void surfels_of_row(const SurfelRule& rule, PlaneRing& planes, const RayTable& rays, const Grid& grid, int v,
                    int u_begin, int u_end, std::int32_t* candidates, std::uint64_t* found, FoundSurfel* row) {
  const int half = planes.half_px();
  Neighbourhood n{planes.row(v), planes.row(v - half), planes.row(v + half), nullptr,
                  nullptr,       grid.stride(),        planes.u_begin(),     v,
                  half};
  if (rule.distorted) {
    const auto ray_at = static_cast<std::ptrdiff_t>(RayTable::at(grid, planes.u_begin(), v));
    n.ray_x = rays.x.data() + ray_at;
    n.ray_y = rays.y.data() + ray_at;
  }
  const int count = list_candidates(rule, n, planes.index(u_begin), planes.index(u_end), found, candidates);
  if (count > 0) HWY_DYNAMIC_DISPATCH(SurfelsAt)(rule, n, candidates, count, found, row);
}

}  // namespace tubetrack
#endif
