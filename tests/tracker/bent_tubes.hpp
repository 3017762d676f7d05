#pragma once

#include <random>
#include <string>
#include <vector>

#include "tubetrack/tracker/part_chain.hpp"
#include "tubetrack/tracker/segments.hpp"

namespace tubetrack::test {

/// A measured centreline that owns its nodes.
struct OwnedLine {
  std::vector<Eigen::Vector3d> nodes_m;
  std::vector<Eigen::Matrix3d> covariance_m2;
  double radius_m = 0.0;
  double correlation_m = 0.0;

  MeasuredCenterline view() const { return {nodes_m, covariance_m2, radius_m, correlation_m, 0.0}; }
};

/// A tube as a bender makes it: bends of 30–180° and of 1.5–10 tube diameters, straights of 1–6 diameters, planes
/// turned at random. In front of a camera, in no special direction.
PartChain random_chain(std::mt19937_64& random, std::size_t bends, double tube_radius_m);

/// Nodes half a radius apart, each off by σ in every direction: independently, or smoothly over `correlation_m`.
OwnedLine noisy_line(const PartChain& chain, double tube_radius_m, double sigma_m, double correlation_m,
                     std::mt19937_64& random);

inline constexpr double kTubeRadius_m = 0.0125;

/// A tube of kTubeRadius_m. Lengths and radii in tube radii, angles in degrees.
PartChain chain_of(const std::vector<ChainBend>& bends, double closing);
OwnedLine line_of(const PartChain& chain, double sigma_radii, double correlation_radii, std::uint64_t seed);

/// A letter a segment: S, A or F.
std::string types_of(const CenterlineParts& parts);

double rotation_error(double a_rad, double b_rad);

/// The same centreline from its other end.
PartChain reversed(const PartChain& chain);

}  // namespace tubetrack::test
