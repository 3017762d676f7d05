#pragma once

#include <optional>

#include "tubetrack/tracker/segments.hpp"

namespace tubetrack {

/// The tables of tube bending for a chain of straights and arcs (goes past the paper, whose section 3 ends at the
/// parts). XYZ points are in the chain's frame. A row of LRA is ill-conditioned where
/// - its angle or its bend radius is uncertain by more than a tenth of itself (1 σ), or its rotation by more than
///   0.1 rad: bends that turn little, or with little of them in view;
/// - its bend may go on beyond the tube's end: the outer straight is shorter than 2 σ of its length;
/// - no node decides one of them (σ 0);
/// - it is the closing row and its length is below 2 σ.
BendTable bend_table_of(const FittedChain& fitted);
/// The same into an empty table.
void add_bends(const FittedChain& fitted, BendTable& table);

/// Into so many pieces a bend is split for XYZ points: a bend above 150° into two, above 300° into three.
std::size_t pieces_of_bend(double angle_rad);

/// The inverse: the chain that a table describes, in the frame of its XYZ points, which give the start, the direction
/// and the first bend's plane; all else is from LRA. Nothing where the table can't be a tube's: not two distinct
/// points, no closing row, a length or an angle below 0, a bend without a radius, a number that is not finite.
std::optional<PartChain> chain_of(const BendTable& table);

/// The centreline that a table describes: points at most `step_m` apart, as points_along. Empty where chain_of is.
std::vector<Eigen::Vector3d> centerline_of(const BendTable& table, double step_m);

}  // namespace tubetrack
