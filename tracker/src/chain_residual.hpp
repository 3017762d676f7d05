#pragma once

#include <Eigen/Core>
#include <vector>

#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/segments.hpp"

namespace tubetrack {

/// The places of a chain's parameters in its vector: the start's shift across (along `towards`, then along
/// `direction` × `towards`), its turn (about the same two), then four a bend.
inline constexpr Eigen::Index kStartParameters = 4;
inline constexpr Eigen::Index kBendParameters = 4;
enum class BendParameter : Eigen::Index { straight = 0, rotation = 1, log_radius = 2, angle = 3 };

inline Eigen::Index place_of(std::size_t bend, BendParameter parameter) {
  return kStartParameters + kBendParameters * static_cast<Eigen::Index>(bend) + static_cast<Eigen::Index>(parameter);
}
Eigen::Index parameter_count(const PartChain& chain);

/// The motion of a point that is carried along: `turn` × point + `shift` + `stretch` · point, points from the start.
struct Carry {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double stretch = 0.0;
};

/// What each parameter does to all that lies behind its bend.
RecycledVector<Carry> carries_of(const PlacedChain& placed, const PartChain& chain);

/// What points of a surface around one part of the chain (a straight, or an arc) say of it: each moves the part
/// rigidly, or, in an arc, with the arc's radius. Sums over their (along, arm × along, along · way into the arc, 1).
struct PartSums {
  using Row = Eigen::Matrix<double, 8, 1>;
  Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
  Row gradient = Row::Zero();

  void add(const ChainPoint& point, const Eigen::Vector3d& along, const PlacedChain& placed,
           const Eigen::Vector3d& start_m, double weight, double residual_m);
};

/// Two a bend (its straight, its arc) and the last straight.
inline std::size_t part_of(const ChainPoint& point) {
  return 2 * point.bend + (point.in_arc ? 1 : 0);
}

/// The equations of all parts together: derivatives by the chain's parameters and, last, by the tube's radius.
void put_together(const std::vector<PartSums>& parts, const RecycledVector<Carry>& carries, RecycledMatrix& normal,
                  RecycledColumn& gradient);

/// The place on the chain nearest to a point, by Newton steps from `foot_m`, to a tenth of the tube's radius squared
/// over the bend's.
double nearer_foot(const PlacedChain& placed, const Eigen::Vector3d& point_m, double foot_m, double tube_radius_m);

/// Residual of one node and the two directions that it is measured along.
struct Probe {
  ChainPoint point;
  Eigen::Matrix<double, 2, 3> along;  ///< whitened
  Eigen::Vector2d residual;
};

/// At the node's foot on the chain; weighted by the node's covariance and a floor.
Probe probe_of(const PlacedChain& placed, const MeasuredCenterline& line, std::size_t node, double foot_m);

/// Whitened residuals of all nodes at their feet (two a node), which are first brought nearer by a Newton step, and
/// their derivatives. Returns the sum of their squares.
double evaluate(const PartChain& chain, const MeasuredCenterline& line, RecycledVector<double>& foot_m,
                RecycledColumn& residual, RecycledMatrix& jacobian);

}  // namespace tubetrack
