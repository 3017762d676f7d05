#include "tubetrack/tracker/fit.hpp"

#include <algorithm>
#include <cmath>

#include "band_solver.hpp"
#include "normal_equations.hpp"
#include "varying_fit.hpp"

namespace tubetrack {

ResidualTerm residual_of(const TubeModel& model, const Observation& observation) {
  ResidualTerm term = residual_on(polynomials_of(model.spline), model.radius_m, observation);
  if (term.valid) term.basis = basis_at(model.spline, term.t);
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
  if (options.varying_radius && free_radius && options.suppleness >= 1.0)
    return fit_varying_tube(model, observations, options);
  if (options.radius_m) model.radius_m = *options.radius_m;
  if (observations.size() < 20) return std::nullopt;
  const SortedObservations sorted = sort_by_stretch(observations, model.spline.control_m.size() - 3);
  FitQuality quality;
  for (int step = 0; step < options.gauss_newton_steps; ++step) {
    NormalEquations eq = normal_equations(model, sorted, options);
    if (eq.used < 20) return std::nullopt;
    const bool last_step = step + 1 == options.gauss_newton_steps;
    if (last_step) {
      quality.observed.vector = eq.observed * parameters_of(model) + eq.observed_right;
      quality.observed.matrix = std::move(eq.observed);
    }
    const BandSolver solver(eq.matrix);
    if (!solver.ok()) return std::nullopt;
    const Eigen::VectorXd change = solver.solve(eq.right);
    if (!change.allFinite()) return std::nullopt;
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
    if (last_step && options.want_covariance) {
      quality.covariance = solver.inverse_in_band();
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
