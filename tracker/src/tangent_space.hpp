#pragma once

#include <Eigen/Core>

#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/segments.hpp"

namespace tubetrack {

/// The tangent space of a centreline (paper, section 3) in three dimensions: against the length, the angle accumulated
/// since the start, with its direction in a frame that is carried along the line without twist.
struct TangentSpace {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< where the angle is 0
  Eigen::Vector3d across[2];                             ///< the frame there: what an angle's two components turn to
  struct Sample {
    double along_m = 0.0;
    Eigen::Vector2d angle_rad = Eigen::Vector2d::Zero();
    double weight = 0.0;  ///< 1/σ²
  };
  RecycledVector<Sample> samples;
};

/// The length along the nodes' polyline up to each of them.
RecycledVector<double> lengths_along(const MeasuredCenterline& line);

TangentSpace tangent_space(const MeasuredCenterline& line);

/// A first guess of a line's parts: the cheapest cut of its tangent space into pieces of constant angle (straights) and
/// of collinear angles (arcs). `thrift` scales what a piece costs: the more, the fewer.
PartChain parts_in_tangent_space(const MeasuredCenterline& line, double thrift);

}  // namespace tubetrack
