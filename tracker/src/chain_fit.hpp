#pragma once

#include <Eigen/Core>
#include <optional>

#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/segments.hpp"

namespace tubetrack {

/// A chain fitted to a measured centreline.
struct ChainFit {
  PartChain chain;
  RecycledVector<double> foot_m;  ///< of each node: arc length along the chain
  RecycledColumn residual;        ///< whitened, two a node, across the chain
  RecycledMatrix jacobian;        ///< of the residual's model
  double chi2 = 0.0;              ///< sum of squares, as if the nodes were independent
  double cost = 0.0;              ///< BIC with the number of independent nodes: the smaller, the better the model
};

/// Levenberg-Marquardt on the distances of the nodes from the chain, across it, weighted by their covariance and a
/// floor, over all parameters at once. A straight that would become negative stays at 0. The chain begins and ends
/// where the first and the last node have their feet. With `rival_chi2`, that of a chain with more parameters, a fit
/// that will not come near it is left early.
ChainFit fit_chain(const PartChain& initial, const MeasuredCenterline& line, int max_steps,
                   std::optional<double> rival_chi2 = std::nullopt);

/// The inverse of the normal equations of a chain's parameters (and what is behind them). What nothing decides on has
/// no variance here, nor has a straight between arcs that touch: where it is 0, that it may grow by what the arcs give
/// up changes the line in second order only.
RecycledMatrix inverse_where_decided(const PartChain& chain, RecycledMatrix normal);

/// The chain with the σ's of its numbers, from the covariance of its parameters (and what is behind them) and how far,
/// along the tube, its first and last point may be off.
FittedChain with_covariance(const PartChain& chain, const RecycledMatrix& covariance, double first_m, double last_m);

/// The chain with its uncertainty: the covariance of the nodes, correlated along the line, through the fit, inflated
/// where the residuals are larger than it says.
FittedChain with_uncertainty(const ChainFit& fit, const MeasuredCenterline& line);

}  // namespace tubetrack
