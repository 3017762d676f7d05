#pragma once

#include <Eigen/Core>

#include "tubetrack/tracker/part_chain.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

/// The equations of one Gauss-Newton step of a chain: its parameters as chain_residual.hpp orders them; what comes
/// behind them (a radius) is solved for beside them.
struct ChainEquations {
  RecycledMatrix normal;
  RecycledColumn gradient;

  /// Gives a parameter a step of its own, and the others theirs beside it.
  void pin(Eigen::Index k, double step);
};

/// Pins what nothing decides on, and the straights of length 0 that would become negative. Returns how many parameters
/// are free.
int hold_undecided(const PartChain& chain, ChainEquations& equations);

/// normal⁻¹ · right, `normal` symmetric. Up to 64 parameters, of 15 bends, no memory is asked for.
RecycledMatrix solved(const RecycledMatrix& normal, const RecycledMatrix& right);

/// The step that these equations ask for, with no straight shorter than 0.
RecycledColumn solve(const PartChain& chain, ChainEquations& equations);

/// Angles and the logarithms of radii change by 0.5 at most.
void move_chain(PartChain& chain, const RecycledColumn& step);

}  // namespace tubetrack
