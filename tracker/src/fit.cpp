#include "tubetrack/tracker/fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace tubetrack {

namespace {

struct NormalEquations {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;
  double chi2 = 0.0;
  int used = 0;
};

void add_observations(const TubeModel& model, const std::vector<Observation>& observations, bool free_radius,
                      NormalEquations& eq) {
  const Eigen::Index radius_at = eq.matrix.rows() - 1;
  for (const Observation& observation : observations) {
    const ResidualTerm term = residual_of(model, observation);
    if (!term.valid) continue;
    const double weight = 1.0 / (observation.sigma_m * observation.sigma_m);
    Eigen::Matrix<double, 13, 1> row;
    for (Eigen::Index i = 0; i < 4; ++i)
      row.segment<3>(3 * i) = term.basis.value[static_cast<std::size_t>(i)] * term.by_point;
    row[12] = free_radius ? term.by_radius : 0.0;
    const auto at = static_cast<Eigen::Index>(3 * term.basis.first);
    eq.matrix.block<12, 12>(at, at) += weight * row.head<12>() * row.head<12>().transpose();
    eq.matrix.block<12, 1>(at, radius_at) += weight * row[12] * row.head<12>();
    eq.matrix(radius_at, radius_at) += weight * row[12] * row[12];
    eq.right.segment<12>(at) += weight * term.residual_m * row.head<12>();
    eq.right[radius_at] += weight * term.residual_m * row[12];
    eq.chi2 += weight * term.residual_m * term.residual_m;
    ++eq.used;
  }
}

/// Adds the prior that a combination of neighbouring control points, `first` on, is zero: `weight` is the inverse of
/// its covariance.
template <std::size_t N>
void add_prior(const std::vector<Eigen::Vector3d>& control_m, std::size_t first, const std::array<double, N>& factors,
               const Eigen::Matrix3d& weight, NormalEquations& eq) {
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

/// The third difference is zero on straights and arcs alike, so this smooths without pulling bends inward; moving
/// points along the tube changes nothing that is seen, so that is held, and their spacing kept even.
void add_priors(const TubeModel& model, double suppleness, NormalEquations& eq) {
  const auto& q = model.spline.control_m;
  double spacing = 0.0;
  for (std::size_t k = 0; k + 1 < q.size(); ++k)
    spacing += (q[k + 1] - q[k]).norm() / static_cast<double>(q.size() - 1);
  const auto inverse_square = [](double sigma) { return 1.0 / (sigma * sigma); };
  // Where a straight meets the tightest usual bend (radius 5 R), the third difference is spacing² / 5 R.
  const double third_weight = inverse_square(0.3 * suppleness * spacing * spacing / (5.0 * model.radius_m));
  for (std::size_t k = 0; k + 3 < q.size(); ++k) {
    add_prior<4>(q, k, {-1.0, 3.0, -3.0, 1.0}, third_weight * Eigen::Matrix3d::Identity(), eq);
  }
  // A bend of radius 3 R is one σ: too weak to matter where the surface is seen, enough to hold what is not.
  const double second_weight = inverse_square(suppleness * spacing * spacing / (3.0 * model.radius_m));
  const double even_weight = inverse_square(0.02 * spacing);
  for (std::size_t k = 0; k + 2 < q.size(); ++k) {
    const Eigen::Vector3d along = (q[k + 2] - q[k]).normalized();
    const Eigen::Matrix3d weight =
        second_weight * Eigen::Matrix3d::Identity() + even_weight * along * along.transpose();
    add_prior<3>(q, k, {1.0, -2.0, 1.0}, weight, eq);
  }
  for (std::size_t k = 0; k < q.size(); ++k) {
    const Eigen::Vector3d along = (q[std::min(k + 1, q.size() - 1)] - q[k > 0 ? k - 1 : 0]).normalized();
    const auto at = static_cast<Eigen::Index>(3 * k);
    eq.matrix.block<3, 3>(at, at) += inverse_square(0.03 * spacing) * along * along.transpose();
    // A faint hold on everything keeps ends that nothing observes from running away.
    eq.matrix.block<3, 3>(at, at).diagonal().array() += 1e-3 * inverse_square(model.radius_m);
  }
}

NormalEquations normal_equations(const TubeModel& model, const std::vector<Observation>& observations, bool free_radius,
                                 double suppleness) {
  const auto size = static_cast<Eigen::Index>(3 * model.spline.control_m.size() + 1);
  NormalEquations eq{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  add_observations(model, observations, free_radius, eq);
  add_priors(model, suppleness, eq);
  if (!free_radius) eq.matrix(size - 1, size - 1) = 1.0;
  // A radius that the view hardly determines stays near where it was.
  if (free_radius) eq.matrix(size - 1, size - 1) += 1.0 / (0.25 * model.radius_m * model.radius_m);
  eq.matrix.row(size - 1).head(size - 1) = eq.matrix.col(size - 1).head(size - 1).transpose();
  return eq;
}

}  // namespace

ResidualTerm residual_of(const TubeModel& model, const Observation& observation) {
  ResidualTerm term;
  double t = observation.t;
  double shift = 0.0;  // from the measured point to the predicted one, along the direction
  for (int i = 0; i < 5; ++i) {
    // Off the line's end the tube goes straight on, so only what is across the axis counts.
    const Eigen::Vector3d along = derivative_at(model.spline, t).normalized();
    const auto across = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d { return v - v.dot(along) * along; };
    const Eigen::Vector3d from_axis = across(observation.point_m - point_at(model.spline, t));
    const Eigen::Vector3d ray = across(observation.direction);
    const double a = ray.squaredNorm();
    if (a < 1e-6) return term;
    const double b = ray.dot(from_axis);
    const double discriminant = b * b - a * (from_axis.squaredNorm() - model.radius_m * model.radius_m);
    // The nearer intersection of the whole ray, wherever on it the reading is: whether a reading counts must not
    // depend on its residual. Beyond 80° there is no stable intersection.
    const double slope = -std::sqrt(std::max(discriminant, 0.0)) / model.radius_m;
    if (slope > -0.17) return term;
    const double before = shift;
    shift = (-b + slope * model.radius_m) / a;
    const Eigen::Vector3d outward = (from_axis + shift * ray) / model.radius_m;
    term.by_point = outward / slope;
    term.by_radius = 1.0 / slope;
    const double old_t = t;
    t = foot_parameter(model.spline, observation.point_m + shift * observation.direction, t);
    if (i > 0 && std::abs(shift - before) < 1e-7 && std::abs(t - old_t) < 1e-4) break;
  }
  term.residual_m = -shift;
  term.basis = basis_at(model.spline, t);
  term.valid = true;
  return term;
}

std::optional<FitQuality> fit_tube(TubeModel& model, const std::vector<Observation>& observations,
                                   const FitOptions& options) {
  const bool free_radius = !options.radius_m;
  if (options.radius_m) model.radius_m = *options.radius_m;
  if (observations.size() < 20) return std::nullopt;
  FitQuality quality;
  for (int step = 0; step < options.gauss_newton_steps; ++step) {
    const NormalEquations eq = normal_equations(model, observations, free_radius, options.suppleness);
    if (eq.used < 20) return std::nullopt;
    const Eigen::LDLT<Eigen::MatrixXd> solver(eq.matrix);
    const Eigen::VectorXd change = solver.solve(eq.right);
    if (solver.info() != Eigen::Success || !change.allFinite()) return std::nullopt;
    for (std::size_t k = 0; k < model.spline.control_m.size(); ++k) {
      const Eigen::Vector3d move = change.segment<3>(static_cast<Eigen::Index>(3 * k));
      model.spline.control_m[k] += move * std::min(1.0, model.radius_m / std::max(move.norm(), 1e-12));
    }
    if (free_radius) {
      const double limit = 0.3 * model.radius_m;
      model.radius_m += std::clamp(change[change.size() - 1], -limit, limit);
      if (model.radius_m < options.radius_min_m || model.radius_m > options.radius_max_m) return std::nullopt;
    }
    quality.chi2_per_observation = eq.chi2 / eq.used;
    if (step + 1 == options.gauss_newton_steps) {
      quality.covariance = solver.solve(Eigen::MatrixXd::Identity(eq.matrix.rows(), eq.matrix.cols()));
      quality.covariance *= std::max(1.0, quality.chi2_per_observation);
    }
  }
  const Eigen::Index last = quality.covariance.rows() - 1;
  quality.radius_sigma_m = free_radius ? std::sqrt(std::max(0.0, quality.covariance(last, last))) : 0.0;
  return quality;
}

}  // namespace tubetrack
