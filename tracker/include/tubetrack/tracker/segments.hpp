#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "tubetrack/tracker/part_chain.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// A centreline as it was measured: nodes in order, in any one frame.
struct MeasuredCenterline {
  std::span<const Eigen::Vector3d> nodes_m;
  std::span<const Eigen::Matrix3d> covariance_m2;  ///< one a node
  double radius_m = 0.0;                           ///< of the tube: the scale of what counts as a bend
  double correlation_m = 0.0;                      ///< nodes this far apart err independently; 0: all do
  double unsure_end_m = 0.0;  ///< nodes nearer than this to an end may be off by a good part of the radius
};

/// A tube's centreline as fit_tube makes it (a view; the tube must outlive it): its nodes err together over two
/// spacings of its knots, and at its ends the caps of the tube bend it.
MeasuredCenterline fitted_centerline(const Tube& tube);

/// Standard deviations of a ChainBend's numbers, always finite; 0 for what is not measured: the first rotation, the
/// straight between arcs that touch, and what no node decides.
struct BendSigma {
  double straight_m = 0.0;
  double rotation_rad = 0.0;
  double angle_rad = 0.0;
  double radius_m = 0.0;
};

/// A chain fitted to a centreline, in the frame of its nodes.
struct FittedChain {
  PartChain chain;
  RecycledVector<BendSigma> sigma;  ///< one a bend
  double closing_sigma_m = 0.0;
};

/// A centreline cut into its parts.
struct CenterlineParts {
  RecycledVector<Segment> segments;   ///< in order and without gaps, along the fitted chain; empty: no parts found
  std::optional<FittedChain> fitted;  ///< unless a part is `free`, or there are no parts
};

/// Straight and toric parts of a centreline (paper, section 3): arcs are where the midpoints of the tangent space are
/// collinear; the parts so found are fitted to the nodes as one tangent-continuous chain, and their number is the one
/// that explains the nodes best for its parameters (BIC). What is neither straight nor an arc is `free`: what the nodes
/// don't follow, and three arcs or more in a row. No parts where fewer than 3 nodes are distinct, where a number is not
/// finite, or where the radius or a variance can't be one.
CenterlineParts cut_into_parts(const MeasuredCenterline& line);

/// The straight and toric parts of a chain, in order and without gaps.
RecycledVector<Segment> segments_of(const PartChain& chain);

}  // namespace tubetrack
