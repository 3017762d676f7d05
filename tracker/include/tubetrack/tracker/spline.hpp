#pragma once

#include <Eigen/Core>
#include <array>
#include <initializer_list>
#include <span>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// Uniform cubic B-spline: the shape of a centreline. Parameter t in [0, spans()], one span a control point.
struct Spline {
  RecycledVector<Eigen::Vector3d> control_m;  ///< at least 4
  int first_span = 0;  ///< number of its first span: spans keep theirs as the line grows and shrinks at its front

  double spans() const { return static_cast<double>(control_m.size()) - 3.0; }
};

/// Control points this far apart follow the step in curvature where a straight meets a bend of radius 5 R to a few
/// thousandths of R.
inline constexpr double kKnotSpacingRadii = 1.25;

/// Four control points shape the curve at t: `first` and the three after it, with these weights.
struct SplineBasis {
  std::size_t first = 0;
  std::array<double, 4> value{};
  std::array<double, 4> derivative{};  ///< by t
};

/// t is clamped to [0, spans()].
SplineBasis basis_at(const Spline& spline, double t);
/// Everything at one place of the curve.
struct CurvePoint {
  SplineBasis basis;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d derivative_m = Eigen::Vector3d::Zero();  ///< by t
};
CurvePoint curve_at(const Spline& spline, double t);
Eigen::Vector3d point_at(const Spline& spline, double t);
Eigen::Vector3d derivative_at(const Spline& spline, double t);

/// One span of the curve as a cubic polynomial of s = t less the span's number: factors of 1, s, s² and s³.
using SpanPolynomial = std::array<Eigen::Vector3d, 4>;
/// Of all spans: quicker where the curve is asked for in many places.
RecycledVector<SpanPolynomial> polynomials_of(const Spline& spline);

/// The parameter near `t` whose point is closest to `point_m`: three Newton steps on the foot-point condition.
double foot_parameter(const Spline& spline, const Eigen::Vector3d& point_m, double t);

/// A spline along a polyline (≥ 2 points), control points `spacing_m` apart or a little less, the polyline's ends at
/// t = 0 and t = spans().
Spline spline_along(std::span<const Eigen::Vector3d> polyline_m, double spacing_m);
inline Spline spline_along(std::initializer_list<Eigen::Vector3d> polyline_m, double spacing_m) {
  return spline_along(std::span<const Eigen::Vector3d>(polyline_m.begin(), polyline_m.size()), spacing_m);
}

/// One more control point at the front and/or the back, straight on.
void extend(Spline& spline, bool front, bool back);

}  // namespace tubetrack
