#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "chain_fit.hpp"
#include "chain_residual.hpp"
#include "chain_step.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

/// The nodes' noise in the parameters' units: for each node (three columns) what a unit of noise adds to Jᵀ r.
struct NoiseInFit {
  RecycledMatrix own;          ///< parameters × 3 nodes
  RecycledMatrix correlated;   ///< own plus what the nodes before add by correlation
  double expected_chi2 = 0.0;  ///< of the residuals, before the fit takes its part
};

NoiseInFit noise_of(const ChainFit& fit, const MeasuredCenterline& line) {
  const PlacedChain placed = place(fit.chain);
  const auto nodes = static_cast<Eigen::Index>(line.nodes_m.size());
  const double least_m2 = std::pow(1e-6 * line.radius_m, 2);
  NoiseInFit noise;
  noise.own.resize(fit.jacobian.cols(), 3 * nodes);
  noise.correlated.resize(fit.jacobian.cols(), 3 * nodes);
  // Smooth noise: its correlation is (1 + d) exp(−d), in units of which the integral over both sides is 4. Such sums
  // over all nodes before are carried on from node to node.
  const double scale_m = 0.25 * line.correlation_m;
  RecycledMatrix near = Eigen::MatrixXd::Zero(fit.jacobian.cols(), 3);  // Σ exp(−d)
  RecycledMatrix far = near;                                            // Σ d exp(−d)
  for (Eigen::Index i = 0; i < nodes; ++i) {
    const auto node = static_cast<std::size_t>(i);
    const Probe probe = probe_of(placed, line, node, fit.foot_m[node]);
    const Eigen::Matrix3d covariance = line.covariance_m2[node] + least_m2 * Eigen::Matrix3d::Identity();
    const Eigen::Matrix<double, 2, 3> whitened = probe.along * Eigen::Matrix3d(covariance.llt().matrixL());
    noise.expected_chi2 += whitened.squaredNorm();
    noise.own.middleCols<3>(3 * i).noalias() = fit.jacobian.middleRows<2>(2 * i).transpose() * whitened;
    noise.correlated.middleCols<3>(3 * i) = noise.own.middleCols<3>(3 * i);
    if (i == 0 || line.correlation_m <= 0.0) continue;
    const double step = std::abs(fit.foot_m[node] - fit.foot_m[node - 1]) / scale_m;
    near += noise.own.middleCols<3>(3 * (i - 1));
    far = std::exp(-step) * (far + step * near);
    near *= std::exp(-step);
    noise.correlated.middleCols<3>(3 * i) += near + far;
  }
  return noise;
}

RecycledMatrix covariance_of(const ChainFit& fit, const MeasuredCenterline& line) {
  const NoiseInFit noise = noise_of(fit, line);
  const RecycledMatrix inverse = inverse_where_decided(fit.chain, fit.jacobian.transpose() * fit.jacobian);
  const RecycledMatrix half = noise.own * noise.correlated.transpose();
  RecycledMatrix spread = half + half.transpose();
  spread.noalias() -= noise.own * noise.own.transpose();
  const double taken = inverse.cwiseProduct(spread.transpose()).sum();
  const double left = std::max(0.2 * noise.expected_chi2, noise.expected_chi2 - taken);
  const RecycledMatrix left_part = inverse * spread;
  const RecycledMatrix covariance = left_part * inverse;
  return std::max(1.0, left > 0.0 ? fit.chi2 / left : 1.0) * covariance;
}

double sigma_along(const MeasuredCenterline& line, std::size_t node, const Eigen::Vector3d& tangent) {
  return std::sqrt(std::max(0.0, tangent.dot(line.covariance_m2[node] * tangent)));
}

/// 0 also where the variance is no number.
double root(double variance) {
  return variance > 0.0 && std::isfinite(variance) ? std::sqrt(variance) : 0.0;
}

}  // namespace

RecycledMatrix inverse_where_decided(const PartChain& chain, RecycledMatrix normal) {
  const double least = 1e-12 * normal.diagonal().maxCoeff();
  RecycledColumn decided = Eigen::VectorXd::Ones(normal.rows());
  for (Eigen::Index k = 0; k < normal.rows(); ++k) {
    const Eigen::Index in_bend = k - kStartParameters;
    const bool touching = in_bend >= 0 && in_bend % kBendParameters == 0 && k < parameter_count(chain) &&
                          chain.bends[static_cast<std::size_t>(in_bend / kBendParameters)].straight_m <= 0.0;
    if (normal(k, k) > least && !touching) continue;
    normal.row(k).setZero();
    normal.col(k).setZero();
    normal(k, k) = 1.0;
    decided[k] = 0.0;
  }
  RecycledMatrix right;
  right.setZero(normal.rows(), normal.rows());
  right.diagonal() = decided;
  return solved(normal, right);
}

FittedChain with_covariance(const PartChain& chain, const RecycledMatrix& covariance, double first_m, double last_m) {
  FittedChain fitted;
  fitted.chain = chain;
  const PlacedChain placed = place(chain);
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    const auto sigma = [&](BendParameter parameter) {
      const Eigen::Index k = place_of(i, parameter);
      return root(covariance(k, k));
    };
    fitted.sigma.push_back({sigma(BendParameter::straight), i == 0 ? 0.0 : sigma(BendParameter::rotation),
                            sigma(BendParameter::angle), chain.bends[i].radius_m * sigma(BendParameter::log_radius)});
  }
  // The closing length is what the chain leaves over up to the last node.
  const RecycledVector<Carry> carries = carries_of(placed, chain);
  const Eigen::Vector3d arm = placed.last_start_m - chain.start_m;
  RecycledColumn closing(parameter_count(chain));
  for (Eigen::Index k = 0; k < closing.size(); ++k) {
    const Carry& carry = carries[static_cast<std::size_t>(k)];
    closing[k] = placed.last_tangent.dot(carry.turn.cross(arm) + carry.shift);
  }
  const RecycledColumn spread = covariance.topLeftCorner(closing.size(), closing.size()) * closing;
  fitted.closing_sigma_m = std::hypot(root(closing.dot(spread)), last_m);
  if (fitted.sigma.empty()) {
    fitted.closing_sigma_m = std::hypot(first_m, last_m);
    return fitted;
  }
  fitted.sigma.front().straight_m = std::hypot(fitted.sigma.front().straight_m, first_m);
  if (chain.closing_m <= 0.0) {  // the view ends in the bend
    BendSigma& last = fitted.sigma.back();
    const ChainBend& bend = chain.bends.back();
    last.angle_rad = std::hypot(bend.angle_rad * last.radius_m, last_m) / bend.radius_m;
  }
  return fitted;
}

FittedChain with_uncertainty(const ChainFit& fit, const MeasuredCenterline& line) {
  const PlacedChain placed = place(fit.chain);
  return with_covariance(fit.chain, covariance_of(fit, line), sigma_along(line, 0, fit.chain.direction),
                         sigma_along(line, line.nodes_m.size() - 1, placed.last_tangent));
}

}  // namespace tubetrack
