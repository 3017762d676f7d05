#pragma once

#include <Eigen/Core>

#include "tubetrack/tracker/part_chain.hpp"

namespace tubetrack {

/// The equations of one Gauss-Newton step of a chain: its parameters as chain_residual.hpp orders them; what comes
/// behind them (a radius) is solved for beside them.
struct ChainEquations {
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;

  /// Gives a parameter a step of its own, and the others theirs beside it.
  void pin(Eigen::Index k, double step);
};

/// Pins what nothing decides on, and the straights of length 0 that would become negative. Returns how many parameters
/// are free.
int hold_undecided(const PartChain& chain, ChainEquations& equations);

/// The step that these equations ask for, with no straight shorter than 0.
Eigen::VectorXd solve(const PartChain& chain, ChainEquations& equations);

/// Angles and the logarithms of radii change by 0.5 at most.
void move_chain(PartChain& chain, const Eigen::VectorXd& step);

}  // namespace tubetrack
