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
    for (Eigen::Index i = 0; i < 4; ++i) row.segment<3>(3 * i) = term.basis.value[static_cast<std::size_t>(i)] * term.by_point;
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

/// The third difference is zero on straights and arcs alike, so this smooths without pulling bends inward; moving
/// points along the tube changes nothing that is seen, so that is held.
void add_priors(const TubeModel& model, NormalEquations& eq) {
  const auto& q = model.spline.control_m;
  const double spacing = (q[1] - q[0]).norm();
  // Where a straight meets the tightest usual bend (radius 5 R), the third difference is spacing² / 5 R.
  const double sigma = 0.5 * spacing * spacing / (5.0 * model.radius_m);
  const double weight = 1.0 / (sigma * sigma);
  constexpr std::array<double, 4> kThird{-1.0, 3.0, -3.0, 1.0};
  for (std::size_t k = 0; k + 3 < q.size(); ++k) {
    const Eigen::Vector3d third = q[k + 3] - 3.0 * q[k + 2] + 3.0 * q[k + 1] - q[k];
    for (std::size_t i = 0; i < 4; ++i) {
      const auto row = static_cast<Eigen::Index>(3 * (k + i));
      for (std::size_t j = 0; j < 4; ++j) {
        const auto col = static_cast<Eigen::Index>(3 * (k + j));
        eq.matrix.block<3, 3>(row, col).diagonal().array() += weight * kThird[i] * kThird[j];
      }
      eq.right.segment<3>(row) -= weight * kThird[i] * third;
    }
  }
  for (std::size_t k = 0; k < q.size(); ++k) {
    const Eigen::Vector3d along = (q[std::min(k + 1, q.size() - 1)] - q[k > 0 ? k - 1 : 0]).normalized();
    const double hold = 1.0 / (1e-2 * spacing * spacing);
    const auto at = static_cast<Eigen::Index>(3 * k);
    eq.matrix.block<3, 3>(at, at) += hold * along * along.transpose();
    // A faint hold on everything keeps ends that nothing observes from running away.
    eq.matrix.block<3, 3>(at, at).diagonal().array() += 1e-3 / (model.radius_m * model.radius_m);
  }
}

NormalEquations normal_equations(const TubeModel& model, const std::vector<Observation>& observations,
                                 bool free_radius) {
  const auto size = static_cast<Eigen::Index>(3 * model.spline.control_m.size() + 1);
  NormalEquations eq{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  add_observations(model, observations, free_radius, eq);
  add_priors(model, eq);
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
  double slope = 0.0;
  Eigen::Vector3d outward = Eigen::Vector3d::Zero();
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3d point = observation.point_m + shift * observation.direction;
    t = foot_parameter(model.spline, point, t);
    const Eigen::Vector3d from_axis = point - point_at(model.spline, t);
    const double distance = from_axis.norm();
    if (distance < 1e-9) return term;
    outward = from_axis / distance;
    slope = outward.dot(observation.direction);
    if (slope > -0.17) return term;  // beyond 80°, or the far side: no stable intersection
    const double step = (model.radius_m - distance) / slope;
    shift += std::clamp(step, -model.radius_m, model.radius_m);
    if (std::abs(step) < 1e-7) break;
  }
  term.residual_m = -shift;
  term.basis = basis_at(model.spline, t);
  term.by_point = outward / slope;
  term.by_radius = 1.0 / slope;
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
    const NormalEquations eq = normal_equations(model, observations, free_radius);
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
