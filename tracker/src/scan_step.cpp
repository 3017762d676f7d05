#include "scan_step.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "fit_steps.hpp"
#include "shape_priors.hpp"

namespace tubetrack {

namespace {

constexpr int kFewestObservations = 20;

struct ScanEquations {
  BandMatrix matrix;
  RecycledColumn right;
  double chi2 = 0.0;
  int used = 0;
};

/// The basis in the middle of each of a span's stretches.
std::array<std::array<double, 4>, kStretchesPerSpan> basis_of_stretches(const Spline& spline) {
  std::array<std::array<double, 4>, kStretchesPerSpan> values{};
  for (std::size_t k = 0; k < values.size(); ++k)
    values[k] = basis_at(spline, (static_cast<double>(k) + 0.5) / kStretchesPerSpan).value;
  return values;
}

/// What a span's stretches say of its four control points and the radius, summed up before it goes into the band.
struct SpanEquations {
  std::array<std::array<double, 6>, 10> tied{};  // of point i with point j up to i: xx, xy, xz, yy, yz, zz
  std::array<Eigen::Vector3d, 4> right, radius;

  SpanEquations() {
    right.fill(Eigen::Vector3d::Zero());
    radius.fill(Eigen::Vector3d::Zero());
  }

  void add(const StretchSums& s, const std::array<double, 4>& basis) {
    const Eigen::Matrix3d& m = s.point_point;
    const std::array<double, 6> own{m(0, 0), m(1, 0), m(2, 0), m(1, 1), m(2, 1), m(2, 2)};
    std::size_t pair = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j <= i; ++j, ++pair) {
        const double both = basis[i] * basis[j];
        for (std::size_t k = 0; k < own.size(); ++k) tied[pair][k] += both * own[k];
      }
      right[i] += basis[i] * s.point_residual;
      radius[i] += basis[i] * s.point_radius;
    }
  }

  void add_to(std::size_t first, bool free_radius, ScanEquations& eq) const {
    double* const radius_row = eq.matrix.row(eq.matrix.rows() - 1);
    std::size_t pair = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j <= i; ++j, ++pair) {
        const auto& [xx, xy, xz, yy, yz, zz] = tied[pair];
        Eigen::Matrix3d block;
        block << xx, xy, xz, xy, yy, yz, xz, yz, zz;
        eq.matrix.add(first + i, first + j, block);
      }
      const auto row = static_cast<Eigen::Index>(3 * (first + i));
      eq.right.segment<3>(row) += right[i];
      for (Eigen::Index axis = 0; free_radius && axis < 3; ++axis) radius_row[row + axis] += radius[i][axis];
    }
  }
};

/// As observed_equations.
ScanEquations observed_by(const RecycledVector<StretchSums>& stretches, const TubeModel& model, bool free_radius) {
  const auto size = static_cast<Eigen::Index>(3 * model.spline.control_m.size() + 1);
  const Eigen::Index radius_at = size - 1;
  ScanEquations eq{BandMatrix(size), Eigen::VectorXd::Zero(size)};
  const auto basis = basis_of_stretches(model.spline);
  for (std::size_t begin = 0; begin < stretches.size(); begin += kStretchesPerSpan) {
    SpanEquations span;
    const int used = eq.used;
    for (std::size_t k = 0; k < kStretchesPerSpan; ++k) {
      const StretchSums& s = stretches[begin + k];
      if (s.used == 0) continue;
      eq.used += s.used;
      eq.chi2 += s.chi2;
      span.add(s, basis[k]);
      if (!free_radius) continue;
      eq.matrix.row(radius_at)[radius_at] += s.radius_radius;
      eq.right[radius_at] += s.radius_residual;
    }
    if (eq.used > used) span.add_to(begin / kStretchesPerSpan, free_radius, eq);
  }
  return eq;
}

/// As normal_equations.
void add_priors(const TubeModel& model, bool free_radius, ScanEquations& eq) {
  const auto& q = model.spline.control_m;
  const auto informed = [&](std::size_t k) {
    const auto at = static_cast<Eigen::Index>(3 * k);
    return eq.matrix.at(at, at) > 0.0;
  };
  std::size_t first = 0, last = q.size() - 1;
  while (first < last && !informed(first)) ++first;
  while (last > first && !informed(last)) --last;
  shape_priors(
      model, 1.0, first, last,
      [&](std::size_t k, const auto& factors, const Eigen::Matrix3d& weight) {
        Eigen::Vector3d value = Eigen::Vector3d::Zero();
        for (std::size_t i = 0; i < factors.size(); ++i) value += factors[i] * q[k + i];
        for (std::size_t i = 0; i < factors.size(); ++i) {
          for (std::size_t j = 0; j <= i; ++j) eq.matrix.add(k + i, k + j, factors[i] * factors[j] * weight);
          eq.right.segment<3>(static_cast<Eigen::Index>(3 * (k + i))) -= factors[i] * weight * value;
        }
      },
      [&](std::size_t k, const Eigen::Matrix3d& weight) { eq.matrix.add(k, k, weight); });
  const Eigen::Index radius_at = eq.right.size() - 1;
  // A radius that the view hardly determines stays near where it was.
  eq.matrix.row(radius_at)[radius_at] += free_radius ? inverse_square(0.5 * model.radius_m) : 1.0;
}

std::optional<ScanStepQuality> take_scan_step(TubeModel& model, const SortedObservations& observations,
                                              const FitOptions& options, bool want_covariance) {
  const bool free_radius = !options.radius_m;
  ScanEquations eq = observed_by(sum_stretches(model, observations), model, free_radius);
  if (eq.used < kFewestObservations) return std::nullopt;
  add_priors(model, free_radius, eq);
  const BandSolver solver(eq.matrix);
  if (!solver.ok()) return std::nullopt;
  const RecycledColumn change = solver.solve(eq.right);
  if (!change.allFinite()) return std::nullopt;
  if (!move_by_step(model, change, options)) return std::nullopt;
  const double misfit = std::max(1.0, eq.chi2 / eq.used);
  ScanStepQuality quality;
  if (free_radius) quality.radius_sigma_m = std::sqrt(std::max(0.0, solver.inverse_of_last() * misfit));
  if (!want_covariance) return quality;
  quality.covariance = solver.inverse_band();
  quality.covariance *= misfit;
  return quality;
}

}  // namespace

std::optional<ScanStepQuality> fit_scan_stretch(TubeModel& model, const SortedObservations& observations,
                                                const FitOptions& options) {
  if (options.radius_m) model.radius_m = *options.radius_m;
  if (observations.count < kFewestObservations) return std::nullopt;
  std::optional<ScanStepQuality> quality;
  for (int step = 1; step <= options.gauss_newton_steps; ++step) {
    quality =
        take_scan_step(model, observations, options, options.want_covariance && step == options.gauss_newton_steps);
    if (!quality) break;
  }
  return quality;
}

}  // namespace tubetrack
