#include "chain_fit.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "chain_residual.hpp"
#include "chain_step.hpp"
#include "tangent_space.hpp"

namespace tubetrack {

namespace {

// A last straight shorter than this, in radii, belongs to the bend.
constexpr double kLeastClosingRadii = 0.1;
constexpr double kFirstDamping = 1e-4;
// One step may make χ² worse, by this factor at most.
constexpr double kStray = 100.0;
// After these steps, χ² this many times beyond a rival's (and one a node) won't come near it.
constexpr int kHopelessSteps = 4;
constexpr double kHopeless = 4.0;

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

ChainEquations equations_of(const ChainFit& fit) {
  return {fit.jacobian.transpose() * fit.jacobian, fit.jacobian.transpose() * fit.residual};
}

ChainFit one_step(const ChainFit& fit, const MeasuredCenterline& line, double damping) {
  ChainEquations equations = equations_of(fit);
  hold_undecided(fit.chain, equations);
  equations.normal.diagonal() *= 1.0 + damping;
  ChainFit next;
  next.chain = fit.chain;
  next.foot_m = fit.foot_m;
  move_chain(next.chain, solve(fit.chain, equations));
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
  ChainEquations equations = equations_of(fit);
  const int parameters = hold_undecided(fit.chain, equations);
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
