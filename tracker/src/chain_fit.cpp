#include "chain_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "chain_residual.hpp"
#include "tangent_space.hpp"

namespace tubetrack {

namespace {

// A step may not go farther: rad, or by this factor's logarithm.
constexpr double kLargestStep = 0.5;
constexpr double kLeastAngle_rad = 0.004;
// A last straight shorter than this, in radii, belongs to the bend.
constexpr double kLeastClosingRadii = 0.1;
constexpr double kFirstDamping = 1e-4;
// One step may make χ² worse, by this factor at most.
constexpr double kStray = 100.0;
// After these steps, χ² this many times beyond a rival's (and one a node) won't come near it.
constexpr int kHopelessSteps = 4;
constexpr double kHopeless = 4.0;

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

/// The equations of one step.
struct Equations {
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;

  /// Gives a parameter a step of its own, and the others theirs beside it.
  void pin(Eigen::Index k, double step) {
    gradient -= step * normal.col(k);
    normal.row(k).setZero();
    normal.col(k).setZero();
    normal(k, k) = 1.0;
    gradient[k] = step;
  }
};

/// Of a fit, with what no node decides on held, and the straights of length 0 that would become negative. Returns how
/// many parameters are free.
int set_up(const ChainFit& fit, Equations& equations) {
  equations.normal.noalias() = fit.jacobian.transpose() * fit.jacobian;
  equations.gradient.noalias() = fit.jacobian.transpose() * fit.residual;
  const double least = 1e-12 * equations.normal.diagonal().maxCoeff();
  int free = 0;
  const auto hold = [&](Eigen::Index k, bool held) {
    if (held || !(equations.normal(k, k) > least)) {
      equations.pin(k, 0.0);
    } else {
      ++free;
    }
  };
  for (Eigen::Index k = 0; k < kStartParameters; ++k) hold(k, false);
  for (std::size_t i = 0; i < fit.chain.bends.size(); ++i) {
    const Eigen::Index straight = place_of(i, BendParameter::straight);
    hold(straight,
         fit.chain.bends[i].touching || (fit.chain.bends[i].straight_m <= 0.0 && equations.gradient[straight] <= 0.0));
    for (Eigen::Index k = straight + 1; k < straight + kBendParameters; ++k) hold(k, false);
  }
  return free;
}

/// The step that these equations ask for, with no straight shorter than 0.
Eigen::VectorXd solve(const PartChain& chain, Equations& equations) {
  Eigen::VectorXd step = equations.normal.ldlt().solve(equations.gradient);
  for (std::size_t round = 0; round < chain.bends.size(); ++round) {
    bool held = false;
    for (std::size_t i = 0; i < chain.bends.size(); ++i) {
      const Eigen::Index k = place_of(i, BendParameter::straight);
      if (chain.bends[i].straight_m + step[k] >= -1e-12) continue;
      equations.pin(k, -chain.bends[i].straight_m);
      held = true;
    }
    if (!held) break;
    step = equations.normal.ldlt().solve(equations.gradient);
  }
  return step;
}

/// Lets the chain begin and end at the feet of the first and the last node, and its first bend go `towards`.
void trim(ChainFit& fit, double tube_radius_m) {
  PartChain& chain = fit.chain;
  if (!chain.bends.empty()) {
    chain.towards = Eigen::AngleAxisd(chain.bends.front().rotation_rad, chain.direction) * chain.towards;
    chain.bends.front().rotation_rad = 0.0;
  }
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
  if (chain.bends.empty() || chain.closing_m > kLeastClosingRadii * tube_radius_m) return;
  chain.bends.back().angle_rad += chain.closing_m / chain.bends.back().radius_m;
  chain.closing_m = 0.0;
}

ChainFit one_step(const ChainFit& fit, const MeasuredCenterline& line, double damping) {
  Equations equations;
  set_up(fit, equations);
  equations.normal.diagonal() *= 1.0 + damping;
  ChainFit next;
  next.chain = fit.chain;
  next.foot_m = fit.foot_m;
  move(next.chain, solve(fit.chain, equations));
  next.chi2 = evaluate(next.chain, line, next.foot_m, next.residual, next.jacobian);
  return next;
}

double independent_nodes(const MeasuredCenterline& line) {
  const auto nodes = static_cast<double>(line.nodes_m.size());
  if (line.correlation_m <= 0.0) return nodes;
  return std::min(nodes, lengths_along(line).back() / line.correlation_m + 1.0);
}

/// The chain's ends, and what it costs.
void finish(ChainFit& fit, const MeasuredCenterline& line) {
  trim(fit, line.radius_m);
  fit.chi2 = evaluate(fit.chain, line, fit.foot_m, fit.residual, fit.jacobian);
  Equations equations;
  const int parameters = set_up(fit, equations);
  const double independent = independent_nodes(line);
  fit.cost =
      fit.chi2 * independent / static_cast<double>(line.nodes_m.size()) + parameters * std::log(2.0 * independent);
}

}  // namespace

ChainFit fit_chain(const PartChain& initial, const MeasuredCenterline& line, int max_steps,
                   std::optional<double> rival_chi2) {
  ChainFit fit;
  fit.chain = initial;
  fit.foot_m = lengths_along(line);
  fit.chi2 = evaluate(fit.chain, line, fit.foot_m, fit.residual, fit.jacobian);
  ChainFit best = fit;
  const auto nodes = static_cast<double>(line.nodes_m.size());
  double damping = kFirstDamping;
  bool strayed = false;
  for (int step = 0; step < max_steps; ++step) {
    ChainFit next = one_step(fit, line, damping);
    const double gain = best.chi2 - next.chi2;
    if (std::abs(gain) < 0.01 + 1e-5 * best.chi2) {
      if (gain > 0.0) best = std::move(next);
      break;
    }
    if (gain > 0.0) {
      best = next;
      damping *= 0.1;
      strayed = false;
    } else if (strayed || !(next.chi2 < kStray * best.chi2)) {
      next = best;
      damping = std::max(kFirstDamping, 10.0 * damping);
      strayed = false;
    } else {
      strayed = true;  // valleys are bent: the next step may lead back to the ground, farther on
    }
    fit = std::move(next);
    if (step >= kHopelessSteps && rival_chi2 && best.chi2 > kHopeless * (*rival_chi2 + nodes)) break;
  }
  finish(best, line);
  return best;
}

}  // namespace tubetrack
