#include "normal_equations.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "shape_priors.hpp"
#include "stretch_sums.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

/// Adds the prior that a combination of neighbouring control points, `first` on, is zero: `weight` is the inverse of
/// its covariance.
template <std::size_t N>
void add_prior(const RecycledVector<Eigen::Vector3d>& control_m, std::size_t first,
               const std::array<double, N>& factors, const Eigen::Matrix3d& weight, NormalEquations& eq) {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < N; ++i) value += factors[i] * control_m[first + i];
  for (std::size_t i = 0; i < N; ++i) {
    const auto row = static_cast<Eigen::Index>(3 * (first + i));
    for (std::size_t j = 0; j < N; ++j) {
      eq.matrix.block<3, 3>(row, static_cast<Eigen::Index>(3 * (first + j))) += factors[i] * factors[j] * weight;
    }
    eq.right.segment<3>(row) -= factors[i] * weight * value;
  }
}

/// The first and the last control point of which the equations say anything so far.
std::pair<std::size_t, std::size_t> informed_range(const NormalEquations& eq) {
  const auto informed = [&](std::size_t k) {
    const auto at = static_cast<Eigen::Index>(3 * k);
    return eq.matrix(at, at) > 0.0;
  };
  std::size_t first = 0;
  auto last = static_cast<std::size_t>(eq.matrix.rows() / 3 - 1);
  while (first < last && !informed(first)) ++first;
  while (last > first && !informed(last)) --last;
  return {first, last};
}

void add_priors(const TubeModel& model, double suppleness, NormalEquations& eq) {
  const auto [first, last] = informed_range(eq);
  shape_priors(
      model, suppleness, first, last,
      [&](std::size_t k, const auto& factors, const Eigen::Matrix3d& weight) {
        add_prior(model.spline.control_m, k, factors, weight, eq);
      },
      [&](std::size_t k, const Eigen::Matrix3d& weight) {
        const auto at = static_cast<Eigen::Index>(3 * k);
        eq.matrix.block<3, 3>(at, at) += weight;
      });
}

}  // namespace

ResidualTerm residual_on(const RecycledVector<SpanPolynomial>& curve, double radius_m, const Observation& observation) {
  const auto spans = static_cast<double>(curve.size());
  const Eigen::Vector3d& direction = observation.direction;
  ResidualTerm term;
  term.t = std::clamp(observation.t, 0.0, spans);
  constexpr int kRounds = 4;
  for (int i = 0; i < kRounds; ++i) {
    const std::size_t span = std::min(static_cast<std::size_t>(term.t), curve.size() - 1);
    const auto& [c0, c1, c2, c3] = curve[span];
    const double s = term.t - static_cast<double>(span);
    const Eigen::Vector3d from_point = observation.point_m - (c0 + s * (c1 + s * (c2 + s * c3)));
    const Eigen::Vector3d derivative = c1 + s * (2.0 * c2 + (3.0 * s) * c3);
    // Off the line's end the tube goes straight on, so only what is across the axis counts.
    const double per_speed2 = 1.0 / derivative.squaredNorm();
    const double point_along = from_point.dot(derivative) * per_speed2;
    const double ray_along = direction.dot(derivative) * per_speed2;
    const Eigen::Vector3d from_axis = from_point - point_along * derivative;
    const Eigen::Vector3d ray = direction - ray_along * derivative;
    const double a = ray.squaredNorm();
    if (a < 1e-6) return term;
    const double b = ray.dot(from_axis);
    const double discriminant = b * b - a * (from_axis.squaredNorm() - radius_m * radius_m);
    // The nearer intersection of the whole ray, wherever on it the reading is: whether a reading counts must not
    // depend on its residual. Beyond 80° there is no stable intersection.
    const double slope = -std::sqrt(std::max(discriminant, 0.0)) / radius_m;
    if (slope > -0.17) return term;
    const double shift = (-b + slope * radius_m) / a;  // from the measured point to the predicted one
    term.residual_m = -shift;
    term.by_point = (from_axis + shift * ray) / (radius_m * slope);
    term.by_radius = 1.0 / slope;
    // The tangent's cylinder is the tube to second order, so its foot need not be exact: a hundredth of a span off is
    // below a ten-thousandth of the radius in the tightest bend.
    const double off = point_along + shift * ray_along;
    const double next = std::clamp(term.t + std::clamp(off, -0.5, 0.5), 0.0, spans);
    if (std::abs(next - term.t) < 0.01) break;
    term.t = next;
  }
  term.valid = true;
  return term;
}

ObservedEquations& ObservedEquations::operator+=(const ObservedEquations& other) {
  matrix += other.matrix;
  right += other.right;
  chi2 += other.chi2;
  used += other.used;
  return *this;
}

ObservedEquations observed_equations(const TubeModel& model, const SortedObservations& observations, bool free_radius) {
  const auto size = static_cast<Eigen::Index>(3 * model.spline.control_m.size() + 1);
  const Eigen::Index radius_at = size - 1;
  ObservedEquations eq{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  const RecycledVector<StretchSums> stretches = sum_stretches(model, observations);
  for (std::size_t k = 0; k < stretches.size(); ++k) {
    const StretchSums& s = stretches[k];
    if (s.used == 0) continue;
    eq.used += s.used;
    eq.chi2 += s.chi2;
    // All share the spline's weights at the stretch's middle: that changes which mean of them is taken, not what it is
    // a mean of.
    const SplineBasis basis = basis_at(model.spline, (static_cast<double>(k) + 0.5) / kStretchesPerSpan);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto row = static_cast<Eigen::Index>(3 * (basis.first + i));
      for (std::size_t j = 0; j <= i; ++j) {
        const auto col = static_cast<Eigen::Index>(3 * (basis.first + j));
        eq.matrix.block<3, 3>(row, col) += basis.value[i] * basis.value[j] * s.point_point;
      }
      eq.right.segment<3>(row) += basis.value[i] * s.point_residual;
      if (free_radius) eq.matrix.block<3, 1>(row, radius_at) += basis.value[i] * s.point_radius;
    }
    if (!free_radius) continue;
    eq.matrix(radius_at, radius_at) += s.radius_radius;
    eq.right[radius_at] += s.radius_residual;
  }
  eq.matrix.row(radius_at).head(radius_at) = eq.matrix.col(radius_at).head(radius_at).transpose();
  for (Eigen::Index row = 3; row < radius_at; row += 3) {
    for (Eigen::Index col = std::max<Eigen::Index>(0, row - 9); col < row; col += 3)
      eq.matrix.block<3, 3>(col, row) = eq.matrix.block<3, 3>(row, col).transpose();
  }
  return eq;
}

NormalEquations normal_equations(const TubeModel& model, const ObservedEquations& observed, const FitOptions& options) {
  const bool free_radius = !options.radius_m;
  const Eigen::Index size = observed.right.size();
  NormalEquations eq{observed.matrix, observed.right};
  if (options.prior) {
    eq.matrix += options.prior->matrix;
    eq.right += options.prior->vector;
    eq.right.noalias() -= options.prior->matrix * parameters_of(model);
  }
  add_priors(model, options.suppleness, eq);
  // A radius that the view hardly determines stays near where it was.
  eq.matrix(size - 1, size - 1) += free_radius ? inverse_square(0.5 * model.radius_m) : 1.0;
  if (!free_radius) {
    eq.matrix.row(size - 1).head(size - 1).setZero();
    eq.matrix.col(size - 1).head(size - 1).setZero();
    eq.right[size - 1] = 0.0;
  }
  return eq;
}

}  // namespace tubetrack
