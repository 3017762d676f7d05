#include "predict_row.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "tubetrack/tracker/predict.hpp"
#include "tubetrack/tracker/recycled.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "predict_row.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using DI = hn::Rebind<std::int32_t, D>;
using V = hn::Vec<D>;

HWY_INLINE V Number(double value) {
  return hn::Set(D(), static_cast<float>(value));
}

HWY_INLINE V Dot(V x, V y, V z, float by_x, float by_y, float by_z) {
  return hn::Add(hn::Add(hn::Mul(x, Number(by_x)), hn::Mul(y, Number(by_y))), hn::Mul(z, Number(by_z)));
}

HWY_INLINE V RaysY(const PredictedRow& row, int i) {
  return row.same_y ? hn::Set(D(), *row.same_y) : hn::LoadU(D(), row.ray_y.data() + i);
}

/// Square of the ray's length for one metre of z.
HWY_INLINE V Ray2(V x, V y) {
  return hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), Number(1.0));
}

HWY_INLINE void IntersectPixels(const RowPiece& p, float radius_m, int i, hn::Mask<D> wanted, PredictedRow& row) {
  const D d;
  const V one = Number(1.0);
  const V x = hn::LoadU(d, row.ray_x.data() + i);
  const V y = RaysY(row, i);
  // The ray's point as far away as the piece's middle, from there.
  const V off_x = hn::Sub(hn::Mul(x, Number(p.middle_z_m)), Number(p.middle_x_m));
  const V off_y = hn::Sub(hn::Mul(y, Number(p.middle_z_m)), Number(p.middle_y_m));
  const V ray2 = Ray2(x, y);
  const V ray_along = Dot(x, y, one, p.axis_x, p.axis_y, p.axis_z);
  const V off_along = hn::Add(hn::Mul(off_x, Number(p.axis_x)), hn::Mul(off_y, Number(p.axis_y)));
  const V across2 = hn::Sub(ray2, hn::Mul(ray_along, ray_along));
  const V b = hn::Sub(hn::Add(hn::Mul(off_x, x), hn::Mul(off_y, y)), hn::Mul(off_along, ray_along));
  const V c = hn::Sub(hn::Sub(hn::Add(hn::Mul(off_x, off_x), hn::Mul(off_y, off_y)), hn::Mul(off_along, off_along)),
                      Number(radius_m * radius_m));
  const V discriminant = hn::Sub(hn::Mul(b, b), hn::Mul(across2, c));
  auto hit = hn::And(hn::And(wanted, hn::Gt(discriminant, hn::Zero(d))), hn::Gt(across2, Number(1e-9)));
  if (hn::AllFalse(d, hit)) return;
  const V root = hn::Sqrt(hn::Max(discriminant, hn::Zero(d)));
  const V per_across2 = hn::Div(one, across2);
  const V beyond = hn::Mul(hn::Sub(hn::Neg(b), root), per_across2);
  const V depth = hn::Add(Number(p.middle_z_m), beyond);
  const V hit_x = hn::Add(off_x, hn::Mul(beyond, x));
  const V hit_y = hn::Add(off_y, hn::Mul(beyond, y));
  const V from_start = hn::Add(Dot(hit_x, hit_y, beyond, p.start_x, p.start_y, p.start_z), Number(p.start_off_m));
  const V to_end = hn::Sub(Number(p.end_off_m), Dot(hit_x, hit_y, beyond, p.end_x, p.end_y, p.end_z));
  const V before = hn::LoadU(d, row.depth_m.data() + i);
  hit = hn::And(hn::And(hit, hn::Gt(depth, hn::Zero(d))),
                hn::And(hn::Lt(depth, before), hn::And(hn::Ge(from_start, hn::Zero(d)), hn::Gt(to_end, hn::Zero(d)))));
  if (hn::AllFalse(d, hit)) return;
  const V per_radius = Number(1.0 / static_cast<double>(radius_m));
  const V part = hn::Div(from_start, hn::Add(from_start, to_end));
  const V swept = hn::Add(hn::Sub(hn::Mul(off_y, Number(p.axis_x)), hn::Mul(off_x, Number(p.axis_y))),
                          hn::Mul(hn::Sub(hn::Mul(off_x, y), hn::Mul(off_y, x)), Number(p.axis_z)));
  // Masked stores take a dozen cycles each on some processors; what is beside the hits is a float of this row's own.
  const auto put = [&](V value, std::vector<float>& column) HWY_ATTR {
    hn::StoreU(hn::IfThenElse(hit, value, hn::LoadU(d, column.data() + i)), d, column.data() + i);
  };
  hn::StoreU(hn::IfThenElse(hit, depth, before), d, row.depth_m.data() + i);
  put(hn::Add(Number(p.t_start), hn::Mul(part, Number(p.t_length))), row.t);
  put(hn::Mul(root, per_radius), row.slope);
  put(hn::Mul(swept, per_radius), row.swept);
  put(hn::Sub(Number(p.middle_z_m), hn::Mul(b, per_across2)), row.axis_depth_m);
  put(across2, row.across2);
}

void IntersectRow(const RowPiece& piece, float radius_m, int begin, int end, PredictedRow& row) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  for (int i = begin; i < end; i += lanes) {
    const auto here = static_cast<std::size_t>(end - i);
    IntersectPixels(piece, radius_m, i, hn::FirstN(D(), here), row);
  }
}

/// arccos to 2e-8 for 0 … 1 (Abramowitz and Stegun, 4.4.46).
HWY_INLINE V ArcCosine(V x) {
  constexpr double kFactors[] = {0.0066700901, -0.0170881256, 0.0308918810, -0.0501743046,
                                 0.0889789874, -0.2145988016, 1.5707963050};
  V sum = Number(-0.0012624911);
  for (const double factor : kFactors) sum = hn::Add(hn::Mul(sum, x), Number(factor));
  return hn::Mul(hn::Sqrt(hn::Sub(Number(1.0), x)), sum);
}

/// `depth_sigma_m` at an incidence given by its cosine.
HWY_INLINE V SigmaAt(const NoiseModel& m, double focal_px, V depth, V cosine) {
  constexpr double kCos85 = 0.0871557427;
  const V one = Number(1.0);
  cosine = hn::Max(cosine, Number(kCos85));
  const V theta = ArcCosine(cosine);
  const V grazing = hn::Div(theta, hn::Sub(Number(1.5707963268), theta));
  const V off = hn::Sub(depth, Number(m.axial_reference_m));
  const V gauss = hn::Add(
      hn::Add(Number(m.axial_constant_m), hn::Mul(Number(m.axial_quadratic_per_m), hn::Mul(off, off))),
      hn::Div(hn::Mul(Number(m.axial_grazing), hn::Mul(grazing, grazing)), hn::Sqrt(hn::Max(depth, Number(1e-3)))));
  const V step = hn::Mul(hn::Mul(depth, depth), Number(m.disparity_step_px / m.baseline_focal_m_px));
  const V rounding = hn::Mul(hn::Add(hn::Mul(step, step), Number(m.depth_step_m * m.depth_step_m)), Number(1.0 / 12.0));
  const V cos2 = hn::Mul(cosine, cosine);
  const V pixel = hn::Mul(depth, Number(m.lateral_px / focal_px));
  const V lateral2 = hn::Div(hn::Mul(hn::Mul(pixel, pixel), hn::Sub(one, cos2)), cos2);
  return hn::Sqrt(hn::Add(hn::Add(hn::Mul(gauss, gauss), rounding), lateral2));
}

/// How many pixels from `i` on, of so many as a vector holds, met the tube one after the other.
HWY_INLINE int MetInARow(const PredictedRow& row, int i, int end) {
  const D d;
  const auto met = hn::And(hn::Lt(hn::LoadU(d, row.depth_m.data() + i), hn::Inf(d)),
                           hn::FirstN(d, static_cast<std::size_t>(end - i)));
  const auto first_not = static_cast<int>(hn::FindFirstTrue(d, hn::Not(met)));
  return first_not < 0 ? static_cast<int>(hn::Lanes(d)) : first_not;
}

/// Finishes as many pixels from `i` on as a vector holds, and writes them behind those that are there.
HWY_INLINE void TakePixels(const NoiseModel& noise, double focal_px, double radius_m, int i, std::uint32_t cell,
                           std::uint32_t stride, const PredictedRow& row, PredictedPixels& pixels) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const V one = Number(1.0);
  const V radius = Number(radius_m);
  const std::size_t at = pixels.count;
  const V depth = hn::LoadU(d, row.depth_m.data() + i);
  const V across = hn::Sqrt(hn::LoadU(d, row.across2.data() + i));
  const V lateral = hn::Neg(hn::Div(hn::LoadU(d, row.swept.data() + i), across));
  const V ray2 = Ray2(hn::LoadU(d, row.ray_x.data() + i), RaysY(row, i));
  const V cosine = hn::Min(one, hn::Div(hn::LoadU(d, row.slope.data() + i), hn::Sqrt(ray2)));
  const V pixel = hn::Mul(depth, Number(1.0 / focal_px));
  // The reading is of a point up to a pixel beside its ray: the mean over a curved surface lies behind the surface by
  // half its second derivative times the jitter's variance.
  const V cos_section = hn::Sqrt(hn::Max(Number(0.1), hn::Sub(one, hn::Mul(lateral, lateral))));
  const V jitter = hn::Mul(pixel, Number(noise.lateral_px));
  const V curve = hn::Mul(hn::Mul(hn::Mul(cos_section, cos_section), hn::Mul(cos_section, radius)), across);
  hn::StoreU(hn::Add(hn::Set(du, cell), hn::Mul(hn::Iota(du, 0), hn::Set(du, stride))), du, pixels.cell.data() + at);
  hn::StoreU(depth, d, pixels.depth_m.data() + at);
  hn::StoreU(hn::LoadU(d, row.t.data() + i), d, pixels.t.data() + at);
  hn::StoreU(cosine, d, pixels.cos_incidence.data() + at);
  hn::StoreU(lateral, d, pixels.lateral.data() + at);
  hn::StoreU(hn::LoadU(d, row.axis_depth_m.data() + i), d, pixels.axis_depth_m.data() + at);
  hn::StoreU(across, d, pixels.across.data() + at);
  hn::StoreU(hn::Div(hn::Mul(hn::Sub(one, hn::Abs(lateral)), radius), pixel), d, pixels.margin_px.data() + at);
  hn::StoreU(hn::Div(hn::Mul(Number(0.5), hn::Mul(jitter, jitter)), curve), d, pixels.jitter_bias_m.data() + at);
  hn::StoreU(SigmaAt(noise, focal_px, depth, cosine), d, pixels.sigma_m.data() + at);
}

/// Run by run of pixels that met the tube: what a vector holds beyond a run's end is written over by the next.
void TakeRow(const NoiseModel& noise, double focal_px, double radius_m, int begin, int end, std::size_t first_cell,
             int stride, PredictedRow& row, PredictedPixels& pixels) {
  for (int i = begin; i < end;) {
    const int met = MetInARow(row, i, end);
    if (met == 0) {
      ++i;
      continue;
    }
    const auto cell =
        static_cast<std::uint32_t>(first_cell + static_cast<std::size_t>(i) * static_cast<std::size_t>(stride));
    TakePixels(noise, focal_px, radius_m, i, cell, static_cast<std::uint32_t>(stride), row, pixels);
    pixels.count += static_cast<std::size_t>(met);
    i += met;
  }
  std::fill(row.depth_m.begin() + begin, row.depth_m.begin() + end, std::numeric_limits<float>::infinity());
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(IntersectRow);
HWY_EXPORT(TakeRow);

PredictedRow make_row(int pixels) {
  constexpr std::size_t kLanes = 16;
  const std::size_t size = static_cast<std::size_t>(pixels) + kLanes;
  PredictedRow row;
  for (std::vector<float>* buffer :
       {&row.ray_x, &row.ray_y, &row.t, &row.axis_depth_m, &row.slope, &row.swept, &row.across2})
    buffer->assign(size, 0.0F);
  row.depth_m.assign(size, std::numeric_limits<float>::infinity());
  return row;
}

void intersect_row(const RowPiece& piece, float radius_m, int begin, int end, PredictedRow& row) {
  HWY_DYNAMIC_DISPATCH(IntersectRow)(piece, radius_m, begin, end, row);
}

void take_row(const NoiseModel& noise, double focal_px, double radius_m, int begin, int end, std::size_t first_cell,
              int stride, PredictedRow& row, PredictedPixels& pixels) {
  HWY_DYNAMIC_DISPATCH(TakeRow)(noise, focal_px, radius_m, begin, end, first_cell, stride, row, pixels);
}

}  // namespace tubetrack
#endif
