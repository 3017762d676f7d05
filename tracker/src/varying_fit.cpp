#include "varying_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "band_solver.hpp"
#include "normal_equations.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

// Of the profile before anything is seen, one σ, in radii: how far it bends from knot to knot (a bulge of a tenth of
// the radius, as long as it is wide), its step from knot to knot (a taper of a tenth), and itself.
constexpr double kBend = 0.15, kStep = 0.4, kLevel = 0.5;

double inverse_square(double sigma) {
  return 1.0 / (sigma * sigma);
}

/// Inverse covariance of the control values before anything is seen; their mean is none.
RecycledMatrix smoothness(Eigen::Index values, double radius_m) {
  RecycledMatrix weight = inverse_square(kLevel * radius_m) * Eigen::MatrixXd::Identity(values, values);
  const Eigen::Vector2d step(-1.0, 1.0);
  const Eigen::Vector3d bend(1.0, -2.0, 1.0);
  for (Eigen::Index k = 0; k + 1 < values; ++k)
    weight.block<2, 2>(k, k) += inverse_square(kStep * radius_m) * step * step.transpose();
  for (Eigen::Index k = 0; k + 2 < values; ++k)
    weight.block<3, 3>(k, k) += inverse_square(kBend * radius_m) * bend * bend.transpose();
  return weight;
}

RecycledColumn values_of(const RadiusProfile& profile) {
  return Eigen::VectorXd::Map(profile.offset_m.data(), static_cast<Eigen::Index>(profile.offset_m.size()));
}

/// The equations of centreline and profile, and of each with the other taken out. Frames add up in that form as well as
/// in one great matrix, as long as they see the tube alike, and nothing else need know of the profile.
struct Step {
  ObservedEquations seen;
  NormalEquations line;  ///< with priors, without what earlier frames say
  ProfileEquations profile;
  RecycledMatrix line_alone = {};  ///< observations only, the profile taken out
  RecycledColumn line_alone_right = {};
  RecycledMatrix profile_alone = {};  ///< observations only, the centreline taken out
  RecycledColumn profile_alone_right = {};
};

/// What is known of the profile without this frame, as a matrix and right side.
struct Known {
  RecycledMatrix matrix;
  RecycledColumn right;
};

/// By which the profile is taken out: frames whose places are pooled have each told them with the profile unknown, so
/// what is known of it must not count again with each.
Known for_line(const Known& known, bool places_pooled, double radius_m) {
  if (!places_pooled) return known;
  const Eigen::Index values = known.right.size();
  return {inverse_square(radius_m) * Eigen::MatrixXd::Identity(values, values), Eigen::VectorXd::Zero(values)};
}

bool take_out(const Known& known, Step& step) {
  const ProfileEquations& p = step.profile;
  const Eigen::LDLT<Eigen::MatrixXd> profile_solver(p.own + known.matrix);
  if (profile_solver.info() != Eigen::Success) return false;
  step.line_alone = step.seen.matrix - p.shared * profile_solver.solve(p.shared.transpose());
  step.line_alone_right = step.seen.right - p.shared * profile_solver.solve(p.right + known.right);
  const BandSolver line_solver(step.line.matrix);
  if (!line_solver.ok()) return false;
  RecycledMatrix by_line(p.shared.rows(), p.shared.cols());
  for (Eigen::Index k = 0; k < p.shared.cols(); ++k) by_line.col(k) = line_solver.solve(p.shared.col(k));
  step.profile_alone = p.own - p.shared.transpose() * by_line;
  step.profile_alone_right = p.right - by_line.transpose() * step.line.right;
  return true;
}

/// The centreline's equations to solve: this frame's, its priors and what earlier frames say.
Known line_equations(const Step& step, const Information* prior, const RecycledColumn& parameters) {
  Known line{step.line_alone + (step.line.matrix - step.seen.matrix),
             step.line_alone_right + (step.line.right - step.seen.right)};
  if (prior) {
    line.matrix += prior->matrix;
    line.right += prior->vector - prior->matrix * parameters;
  }
  return line;
}

void move_line(const RecycledColumn& change, TubeModel& model) {
  for (std::size_t k = 0; k < model.spline.control_m.size(); ++k) {
    const Eigen::Vector3d move = change.segment<3>(static_cast<Eigen::Index>(3 * k));
    model.spline.control_m[k] += move * std::min(1.0, model.radius_m / std::max(move.norm(), 1e-12));
  }
}

void move_profile(const RecycledColumn& change, TubeModel& model) {
  const double limit = 0.3 * model.radius_m;
  for (std::size_t k = 0; k < model.profile.offset_m.size(); ++k)
    model.profile.offset_m[k] += std::clamp(change[static_cast<Eigen::Index>(k)], -limit, limit);
}

/// The mean of what is seen becomes the one radius.
void recentre(const RecycledColumn& mean_basis, TubeModel& model, FitQuality& quality) {
  const double mean_m = mean_basis.dot(values_of(model.profile));
  model.radius_m += mean_m;
  for (double& offset_m : model.profile.offset_m) offset_m -= mean_m;
  Information& seen = quality.profile.values;
  if (seen.vector.size() > 0) seen.vector -= mean_m * seen.matrix * Eigen::VectorXd::Ones(seen.vector.size());
}

}  // namespace

Information placed(const ProfileInformation& information, int first, Eigen::Index size) {
  Information result{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  const Eigen::Index values = information.values.vector.size();
  const Eigen::Index from = information.first - first;
  if (values == 0 || from < 0 || from + values > size) return result;
  result.matrix.block(from, from, values, values) = information.values.matrix;
  result.vector.segment(from, values) = information.values.vector;
  return result;
}

ProfileEquations profile_equations(const TubeModel& model, const RecycledVector<StretchSums>& stretches) {
  const auto size = static_cast<Eigen::Index>(3 * model.spline.control_m.size() + 1);
  const auto values = static_cast<Eigen::Index>(model.profile.offset_m.size());
  ProfileEquations eq{Eigen::MatrixXd::Zero(size, values), Eigen::MatrixXd::Zero(values, values),
                      Eigen::VectorXd::Zero(values), Eigen::VectorXd::Zero(values)};
  double used = 0.0;
  for (std::size_t k = 0; k < stretches.size(); ++k) {
    const StretchSums& s = stretches[k];
    if (s.used == 0) continue;
    used += s.used;
    const double t = (static_cast<double>(k) + 0.5) / kStretchesPerSpan;
    const SplineBasis line = basis_at(model.spline, t);
    const SplineBasis profile = profile_basis_at(model.profile, model.spline, t);
    for (std::size_t j = 0; j < 4; ++j) {
      const auto col = static_cast<Eigen::Index>(profile.first + j);
      for (std::size_t i = 0; i < 4; ++i) {
        const auto row = static_cast<Eigen::Index>(3 * (line.first + i));
        eq.shared.block<3, 1>(row, col) += line.value[i] * profile.value[j] * s.point_radius;
        eq.own(static_cast<Eigen::Index>(profile.first + i), col) +=
            profile.value[i] * profile.value[j] * s.radius_radius;
      }
      eq.right[col] += profile.value[j] * s.radius_residual;
      eq.mean_basis[col] += profile.value[j] * s.used;
    }
  }
  if (used > 0.0) eq.mean_basis /= used;
  return eq;
}

std::optional<FitQuality> fit_varying_tube(TubeModel& model, const SortedObservations& observations,
                                           const FitOptions& options) {
  if (observations.count < 20) return std::nullopt;
  cover(model.profile, model.spline);
  const auto values = static_cast<Eigen::Index>(model.profile.offset_m.size());
  const RecycledMatrix smooth = smoothness(values, model.radius_m);
  const Information earlier =
      placed(options.profile_prior ? *options.profile_prior : ProfileInformation{}, model.profile.first, values);
  FitOptions of_line = options;
  of_line.radius_m = model.radius_m;
  of_line.prior = nullptr;
  FitQuality quality;
  for (int round = 0; round < options.gauss_newton_steps; ++round) {
    ObservedEquations seen = observed_equations(model, observations, false);
    NormalEquations priors = normal_equations(model, seen, of_line);
    Step step{std::move(seen), std::move(priors), profile_equations(model, sum_stretches(model, observations))};
    if (step.seen.used < 20) return std::nullopt;
    const RecycledColumn parameters = parameters_of(model);
    const RecycledColumn offsets = values_of(model.profile);
    const Known known{smooth + earlier.matrix, earlier.vector - (smooth + earlier.matrix) * offsets};
    if (!take_out(for_line(known, options.prior_has_places, model.radius_m), step)) return std::nullopt;
    const Known line = line_equations(step, options.prior, parameters);
    const Eigen::LDLT<Eigen::MatrixXd> line_solver(line.matrix);
    const Eigen::LDLT<Eigen::MatrixXd> profile_solver(step.profile_alone + known.matrix);
    const RecycledColumn line_change = line_solver.solve(line.right);
    const RecycledColumn profile_change = profile_solver.solve(step.profile_alone_right + known.right);
    if (!line_change.allFinite() || !profile_change.allFinite()) return std::nullopt;
    move_line(line_change, model);
    move_profile(profile_change, model);
    quality.chi2_per_observation = step.seen.chi2 / step.seen.used;
    if (round + 1 < options.gauss_newton_steps) continue;
    const double doubt = std::max(1.0, quality.chi2_per_observation);
    quality.observed = {step.line_alone, step.line_alone * parameters + step.line_alone_right};
    quality.profile = {model.profile.first,
                       {step.profile_alone, step.profile_alone * offsets + step.profile_alone_right}};
    quality.profile_covariance = doubt * profile_solver.solve(Eigen::MatrixXd::Identity(values, values));
    if (options.want_covariance)
      quality.covariance = doubt * line_solver.solve(Eigen::MatrixXd::Identity(line.right.size(), line.right.size()));
    const RecycledColumn& mean = step.profile.mean_basis;
    quality.radius_sigma_m = std::sqrt(std::max(0.0, mean.dot(quality.profile_covariance * mean)));
    if (!options.profile_prior) recentre(mean, model, quality);
  }
  if (model.radius_m < options.radius_min_m || model.radius_m > options.radius_max_m) return std::nullopt;
  return quality;
}

}  // namespace tubetrack
