#include "tubetrack/tracker/fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "normal_equations.hpp"

namespace tubetrack {

ResidualTerm residual_of(const TubeModel& model, const Observation& observation) {
  ResidualTerm term;
  term.t = std::clamp(observation.t, 0.0, model.spline.spans());
  constexpr int kRounds = 4;
  for (int i = 0; i < kRounds; ++i) {
    const CurvePoint at = curve_at(model.spline, term.t);
    // Off the line's end the tube goes straight on, so only what is across the axis counts.
    const double speed2 = at.derivative_m.squaredNorm();
    const auto across = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d {
      return v - (v.dot(at.derivative_m) / speed2) * at.derivative_m;
    };
    const Eigen::Vector3d from_point = observation.point_m - at.position_m;
    const Eigen::Vector3d from_axis = across(from_point);
    const Eigen::Vector3d ray = across(observation.direction);
    const double a = ray.squaredNorm();
    if (a < 1e-6) return term;
    const double b = ray.dot(from_axis);
    const double discriminant = b * b - a * (from_axis.squaredNorm() - model.radius_m * model.radius_m);
    // The nearer intersection of the whole ray, wherever on it the reading is: whether a reading counts must not
    // depend on its residual. Beyond 80° there is no stable intersection.
    const double slope = -std::sqrt(std::max(discriminant, 0.0)) / model.radius_m;
    if (slope > -0.17) return term;
    const double shift = (-b + slope * model.radius_m) / a;  // from the measured point to the predicted one
    term.residual_m = -shift;
    term.by_point = (from_axis + shift * ray) / (model.radius_m * slope);
    term.by_radius = 1.0 / slope;
    term.basis = at.basis;
    // The tangent's cylinder is the tube to second order, so its foot need not be exact: a hundredth of a span off is
    // below a ten-thousandth of the radius in the tightest bend.
    const double off = (from_point + shift * observation.direction).dot(at.derivative_m) / speed2;
    const double next = std::clamp(term.t + std::clamp(off, -0.5, 0.5), 0.0, model.spline.spans());
    if (std::abs(next - term.t) < 0.01) break;
    term.t = next;
  }
  term.valid = true;
  return term;
}

Eigen::VectorXd parameters_of(const TubeModel& model) {
  const std::size_t count = model.spline.control_m.size();
  Eigen::VectorXd all(static_cast<Eigen::Index>(3 * count + 1));
  for (std::size_t k = 0; k < count; ++k) all.segment<3>(static_cast<Eigen::Index>(3 * k)) = model.spline.control_m[k];
  all[all.size() - 1] = model.radius_m;
  return all;
}

std::optional<FitQuality> fit_tube(TubeModel& model, const std::vector<Observation>& observations,
                                   const FitOptions& options) {
  const bool free_radius = !options.radius_m;
  if (options.radius_m) model.radius_m = *options.radius_m;
  if (observations.size() < 20) return std::nullopt;
  FitQuality quality;
  for (int step = 0; step < options.gauss_newton_steps; ++step) {
    NormalEquations eq = normal_equations(model, observations, options);
    if (eq.used < 20) return std::nullopt;
    if (step + 1 == options.gauss_newton_steps) {
      quality.observed.vector = eq.observed * parameters_of(model) + eq.observed_right;
      quality.observed.matrix = std::move(eq.observed);
    }
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
    if (step + 1 == options.gauss_newton_steps && options.want_covariance) {
      quality.covariance = solver.solve(Eigen::MatrixXd::Identity(change.size(), change.size()));
      quality.covariance *= std::max(1.0, quality.chi2_per_observation);
    }
  }
  if (free_radius && options.want_covariance) {
    const Eigen::Index last = quality.covariance.rows() - 1;
    quality.radius_sigma_m = std::sqrt(std::max(0.0, quality.covariance(last, last)));
  }
  return quality;
}

}  // namespace tubetrack
