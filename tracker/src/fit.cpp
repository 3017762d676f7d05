#include "tubetrack/tracker/fit.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "band_solver.hpp"
#include "fit_steps.hpp"
#include "normal_equations.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "varying_fit.hpp"

namespace tubetrack {

ResidualTerm residual_of(const TubeModel& model, const Observation& observation) {
  ResidualTerm term = residual_on(polynomials_of(model.spline), model.radius_m, observation);
  if (term.valid) term.basis = basis_at(model.spline, term.t);
  return term;
}

RecycledColumn parameters_of(const TubeModel& model) {
  const std::size_t count = model.spline.control_m.size();
  RecycledColumn all(static_cast<Eigen::Index>(3 * count + 1));
  for (std::size_t k = 0; k < count; ++k) all.segment<3>(static_cast<Eigen::Index>(3 * k)) = model.spline.control_m[k];
  all[all.size() - 1] = model.radius_m;
  return all;
}

bool move_by_step(TubeModel& model, const RecycledColumn& change, const FitOptions& options) {
  for (std::size_t k = 0; k < model.spline.control_m.size(); ++k) {
    const Eigen::Vector3d move = change.segment<3>(static_cast<Eigen::Index>(3 * k));
    model.spline.control_m[k] += move * std::min(1.0, model.radius_m / std::max(move.norm(), 1e-12));
  }
  if (options.radius_m) return true;
  const double limit = 0.3 * model.radius_m;
  model.radius_m += std::clamp(change[change.size() - 1], -limit, limit);
  return model.radius_m >= options.radius_min_m && model.radius_m <= options.radius_max_m;
}

std::optional<FitQuality> take_step(TubeModel& model, ObservedEquations observed, const FitOptions& options) {
  const bool free_radius = !options.radius_m;
  if (observed.used < 20) return std::nullopt;
  const NormalEquations eq = normal_equations(model, observed, options);
  FitQuality quality;
  if (options.want_covariance) {
    quality.observed.vector = observed.right;
    quality.observed.vector.noalias() += observed.matrix * parameters_of(model);
    quality.observed.matrix = std::move(observed.matrix);
  }
  const BandSolver solver(eq.matrix);
  if (!solver.ok()) return std::nullopt;
  const RecycledColumn change = solver.solve(eq.right);
  if (!change.allFinite()) return std::nullopt;
  if (!move_by_step(model, change, options)) return std::nullopt;
  quality.chi2_per_observation = observed.chi2 / observed.used;
  if (!options.want_covariance) return quality;
  quality.covariance = solver.inverse_in_band();
  quality.covariance *= std::max(1.0, quality.chi2_per_observation);
  const Eigen::Index last = quality.covariance.rows() - 1;
  if (free_radius) quality.radius_sigma_m = std::sqrt(std::max(0.0, quality.covariance(last, last)));
  return quality;
}

std::optional<FitQuality> fit_tube(TubeModel& model, const SortedObservations& observations,
                                   const FitOptions& options) {
  if (options.varying_radius && !options.radius_m && options.suppleness >= 1.0)
    return fit_varying_tube(model, observations, options);
  if (options.radius_m) model.radius_m = *options.radius_m;
  if (observations.count < 20) return std::nullopt;
  FitOptions before_last = options;
  before_last.want_covariance = false;
  std::optional<FitQuality> quality;
  for (int step = 1; step <= options.gauss_newton_steps; ++step) {
    quality = take_step(model, observed_equations(model, observations, !options.radius_m),
                        step < options.gauss_newton_steps ? before_last : options);
    if (!quality) break;
  }
  return quality;
}

std::optional<FitQuality> fit_tube(TubeModel& model, std::span<const Observation> observations,
                                   const FitOptions& options) {
  return fit_tube(model, sort_by_stretch(observations, model.spline), options);
}

}  // namespace tubetrack
