#include "chain_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "chain_residual.hpp"
#include "tubetrack/tracker/spline.hpp"

namespace tubetrack {

namespace {

// A step may not go farther: rad, or by this factor's logarithm.
constexpr double kLargestStep = 0.5;
constexpr double kLeastAngle_rad = 0.004;

std::vector<double> lengths_along(const MeasuredCenterline& line) {
  std::vector<double> along_m(1, 0.0);
  for (std::size_t i = 1; i < line.nodes_m.size(); ++i) {
    along_m.push_back(along_m.back() + (line.nodes_m[i] - line.nodes_m[i - 1]).norm());
  }
  return along_m;
}

void move(PartChain& chain, const Eigen::VectorXd& step) {
  const Eigen::Vector3d side = chain.direction.cross(chain.towards);
  chain.start_m += step[0] * chain.towards + step[1] * side;
  const Eigen::Vector3d turn = step[2] * chain.towards + step[3] * side;
  const double angle = turn.norm();
  if (angle > 0.0) {
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
    chain.direction = (rotation * chain.direction).normalized();
    chain.towards = rotation * chain.towards;
  }
  chain.towards = (chain.towards - chain.towards.dot(chain.direction) * chain.direction).normalized();
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    ChainBend& bend = chain.bends[i];
    const auto limited = [&](BendParameter parameter) {
      return std::clamp(step[place_of(i, parameter)], -kLargestStep, kLargestStep);
    };
    bend.straight_m = std::max(0.0, bend.straight_m + step[place_of(i, BendParameter::straight)]);
    bend.rotation_rad += limited(BendParameter::rotation);
    bend.radius_m *= std::exp(limited(BendParameter::log_radius));
    bend.angle_rad = std::max(kLeastAngle_rad, bend.angle_rad + limited(BendParameter::angle));
  }
}

/// Takes a straight of length 0 that would become negative out of the equations, and what no node decides on.
int hold_fixed(const PartChain& chain, Eigen::MatrixXd& normal, Eigen::VectorXd& gradient) {
  const double least = 1e-12 * normal.diagonal().maxCoeff();
  int free = 0;
  for (Eigen::Index k = 0; k < normal.rows(); ++k) {
    const Eigen::Index in_bend = k - kStartParameters;
    const bool straight = in_bend >= 0 && in_bend % kBendParameters == 0;
    const bool at_zero = straight &&
                         chain.bends[static_cast<std::size_t>(in_bend / kBendParameters)].straight_m == 0.0 &&
                         gradient[k] <= 0.0;
    if (!at_zero && normal(k, k) > least) {
      ++free;
      continue;
    }
    normal.row(k).setZero();
    normal.col(k).setZero();
    normal(k, k) = 1.0;
    gradient[k] = 0.0;
  }
  return free;
}

/// Lets the chain begin and end at the feet of the first and the last node.
void trim(ChainFit& fit) {
  PartChain& chain = fit.chain;
  const double first_m = fit.foot_m.front();
  double& first_straight_m = chain.bends.empty() ? chain.closing_m : chain.bends.front().straight_m;
  if (first_m <= first_straight_m || chain.bends.empty()) {
    chain.start_m += first_m * chain.direction;
    first_straight_m -= first_m;
    for (double& foot_m : fit.foot_m) foot_m -= first_m;
  }
  // A bend that begins beyond the last node is none.
  double rest_m = fit.foot_m.back();
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    ChainBend& bend = chain.bends[i];
    rest_m -= bend.straight_m;
    if (rest_m <= 0.0) {
      chain.bends.resize(i);
      rest_m += bend.straight_m;
      break;
    }
    if (rest_m < bend.radius_m * bend.angle_rad) {
      bend.angle_rad = rest_m / bend.radius_m;
      chain.bends.resize(i + 1);
    }
    rest_m -= bend.radius_m * bend.angle_rad;
  }
  chain.closing_m = std::max(0.0, rest_m);
}

}  // namespace

double correlation_of(double radius_m) {
  return 2.0 * kKnotSpacingRadii * radius_m;
}

double independent_nodes(const MeasuredCenterline& line) {
  const auto nodes = static_cast<double>(line.nodes_m.size());
  if (line.correlation_m <= 0.0) return nodes;
  return std::min(nodes, lengths_along(line).back() / line.correlation_m + 1.0);
}

ChainFit fit_chain(const PartChain& initial, const MeasuredCenterline& line, int max_steps) {
  ChainFit fit;
  fit.chain = initial;
  fit.foot_m = lengths_along(line);
  fit.chi2 = evaluate(fit.chain, line, fit.foot_m, fit.residual, fit.jacobian);
  double damping = 1e-3;
  for (int step = 0; step < max_steps; ++step) {
    Eigen::MatrixXd normal = fit.jacobian.transpose() * fit.jacobian;
    Eigen::VectorXd gradient = fit.jacobian.transpose() * fit.residual;
    hold_fixed(fit.chain, normal, gradient);
    normal.diagonal() *= 1.0 + damping;
    ChainFit next;
    next.chain = fit.chain;
    next.foot_m = fit.foot_m;
    move(next.chain, normal.ldlt().solve(gradient));
    next.chi2 = evaluate(next.chain, line, next.foot_m, next.residual, next.jacobian);
    if (!(next.chi2 < fit.chi2)) {
      if (damping > 1e3 || next.chi2 - fit.chi2 < 1e-4) break;
      damping = std::max(1e-2, 10.0 * damping);
      continue;
    }
    damping *= 0.1;
    const bool converged = fit.chi2 - next.chi2 < 0.01 + 1e-4 * next.chi2;
    fit = std::move(next);
    if (converged) break;
  }
  trim(fit);
  fit.chi2 = evaluate(fit.chain, line, fit.foot_m, fit.residual, fit.jacobian);
  Eigen::MatrixXd normal = fit.jacobian.transpose() * fit.jacobian;
  Eigen::VectorXd gradient = fit.jacobian.transpose() * fit.residual;
  const int parameters = hold_fixed(fit.chain, normal, gradient);
  const double independent = independent_nodes(line);
  fit.cost = fit.chi2 * independent / static_cast<double>(line.nodes_m.size()) + parameters * std::log(2.0 * independent);
  return fit;
}

}  // namespace tubetrack
