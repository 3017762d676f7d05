#include "tubetrack/tracker/spline.hpp"

#include <algorithm>
#include <cmath>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

SplineBasis basis_at(const Spline& spline, double t) {
  const double clamped = std::clamp(t, 0.0, spline.spans());
  const double whole = std::min(std::floor(clamped), spline.spans() - 1.0);
  const double s = clamped - whole;
  const double r = 1.0 - s;
  SplineBasis basis;
  basis.first = static_cast<std::size_t>(whole);
  basis.value = {r * r * r / 6.0, (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
                 (-3.0 * s * s * s + 3.0 * s * s + 3.0 * s + 1.0) / 6.0, s * s * s / 6.0};
  basis.derivative = {-0.5 * r * r, 1.5 * s * s - 2.0 * s, -1.5 * s * s + s + 0.5, 0.5 * s * s};
  return basis;
}

CurvePoint curve_at(const Spline& spline, double t) {
  CurvePoint at;
  at.basis = basis_at(spline, t);
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d& control = spline.control_m[at.basis.first + i];
    at.position_m += at.basis.value[i] * control;
    at.derivative_m += at.basis.derivative[i] * control;
  }
  return at;
}

Eigen::Vector3d point_at(const Spline& spline, double t) {
  const SplineBasis basis = basis_at(spline, t);
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) point_m += basis.value[i] * spline.control_m[basis.first + i];
  return point_m;
}

Eigen::Vector3d derivative_at(const Spline& spline, double t) {
  return curve_at(spline, t).derivative_m;
}

RecycledVector<SpanPolynomial> polynomials_of(const Spline& spline) {
  RecycledVector<SpanPolynomial> polynomials;
  for (std::size_t k = 0; k + 3 < spline.control_m.size(); ++k) {
    const Eigen::Vector3d* q = &spline.control_m[k];
    polynomials.push_back({(q[0] + 4.0 * q[1] + q[2]) / 6.0, 0.5 * (q[2] - q[0]), 0.5 * (q[0] - 2.0 * q[1] + q[2]),
                           (q[3] - q[0] + 3.0 * (q[1] - q[2])) / 6.0});
  }
  return polynomials;
}

double foot_parameter(const Spline& spline, const Eigen::Vector3d& point_m, double t) {
  for (int i = 0; i < 3; ++i) {
    const CurvePoint at = curve_at(spline, t);
    const double speed2 = at.derivative_m.squaredNorm();
    if (speed2 <= 0.0) break;
    // Leaving out the curvature term keeps the step safe inside tight bends; it still converges.
    const double step = (point_m - at.position_m).dot(at.derivative_m) / speed2;
    t = std::clamp(t + std::clamp(step, -0.5, 0.5), 0.0, spline.spans());
  }
  return t;
}

Spline spline_along(std::span<const Eigen::Vector3d> polyline_m, double spacing_m) {
  RecycledVector<double> arc_m{0.0};
  for (std::size_t i = 1; i < polyline_m.size(); ++i) {
    arc_m.push_back(arc_m.back() + (polyline_m[i] - polyline_m[i - 1]).norm());
  }
  const int spans = std::max(1, static_cast<int>(std::ceil(arc_m.back() / spacing_m)));
  Spline spline;
  for (int i = 0; i <= spans; ++i) {
    const double at = arc_m.back() * i / spans;
    const auto after = std::upper_bound(arc_m.begin(), arc_m.end(), at);
    const std::size_t hi =
        std::clamp<std::size_t>(static_cast<std::size_t>(after - arc_m.begin()), 1, arc_m.size() - 1);
    const double length = arc_m[hi] - arc_m[hi - 1];
    const double s = length > 0.0 ? (at - arc_m[hi - 1]) / length : 0.0;
    spline.control_m.push_back(polyline_m[hi - 1] + s * (polyline_m[hi] - polyline_m[hi - 1]));
  }
  extend(spline, true, true);
  return spline;
}

void extend(Spline& spline, bool front, bool back) {
  auto& q = spline.control_m;
  double spacing = 0.0;
  for (std::size_t k = 0; k + 1 < q.size(); ++k)
    spacing += (q[k + 1] - q[k]).norm() / static_cast<double>(q.size() - 1);
  // The direction over two spans: one alone would carry its noise on.
  const std::size_t back_by = std::min<std::size_t>(2, q.size() - 1);
  const Eigen::Vector3d after = q.back() + spacing * (q.back() - q[q.size() - 1 - back_by]).normalized();
  const Eigen::Vector3d before = q.front() + spacing * (q.front() - q[back_by]).normalized();
  if (back) q.push_back(after);
  if (!front) return;
  q.insert(q.begin(), before);
  --spline.first_span;
}

}  // namespace tubetrack
