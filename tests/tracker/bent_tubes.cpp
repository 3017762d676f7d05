#include "bent_tubes.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace tubetrack::test {

namespace {

Eigen::Vector3d normal_vector(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  const double y = normal(random);
  return {x, y, normal(random)};
}

/// White noise through a bell of which the correlation's integral is `correlation_m`, at unit variance.
std::vector<Eigen::Vector3d> smooth_noise(std::size_t count, double step_m, double correlation_m,
                                          std::mt19937_64& random) {
  // The correlation of noise behind a bell of width s is a bell of width √2 s, whose integral is 2 √π s.
  const double width = correlation_m / (2.0 * std::sqrt(M_PI)) / step_m;
  const int reach = static_cast<int>(std::ceil(4.0 * width));
  std::vector<Eigen::Vector3d> white(count + 2 * static_cast<std::size_t>(reach));
  for (Eigen::Vector3d& vector : white) vector = normal_vector(random);
  std::vector<Eigen::Vector3d> smooth(count, Eigen::Vector3d::Zero());
  double squares = 0.0;
  for (int k = -reach; k <= reach; ++k) {
    const double weight = width > 0.0 ? std::exp(-0.5 * k * k / (width * width)) : 1.0;
    squares += weight * weight;
    for (std::size_t i = 0; i < count; ++i) smooth[i] += weight * white[i + static_cast<std::size_t>(k + reach)];
  }
  for (Eigen::Vector3d& vector : smooth) vector /= std::sqrt(squares);
  return smooth;
}

}  // namespace

PartChain random_chain(std::mt19937_64& random, std::size_t bends, double tube_radius_m) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  PartChain chain;
  chain.start_m = Eigen::Vector3d(0.0, 0.0, 0.8) + 0.1 * normal_vector(random);
  chain.direction = normal_vector(random).normalized();
  chain.towards = chain.direction.cross(normal_vector(random)).normalized();
  const auto straight_m = [&] { return 2.0 * tube_radius_m * (1.0 + 5.0 * unit(random)); };
  for (std::size_t i = 0; i < bends; ++i) {
    const double rotation_rad = i == 0 ? 0.0 : M_PI * (2.0 * unit(random) - 1.0);
    const double angle_rad = M_PI / 6.0 * (1.0 + 5.0 * unit(random));
    const double before_m = straight_m();
    chain.bends.push_back({before_m, rotation_rad, angle_rad, 2.0 * tube_radius_m * (1.5 + 8.5 * unit(random))});
  }
  chain.closing_m = straight_m();
  return chain;
}

OwnedLine noisy_line(const PartChain& chain, double tube_radius_m, double sigma_m, double correlation_m,
                     std::mt19937_64& random) {
  OwnedLine line;
  line.radius_m = tube_radius_m;
  const double length_m = length_of(chain);
  const auto steps = static_cast<std::size_t>(std::ceil(length_m / (0.5 * tube_radius_m)));
  const double step_m = length_m / static_cast<double>(steps);
  line.correlation_m = correlation_m;
  const PlacedChain placed = place(chain);
  const auto noise = smooth_noise(steps + 1, step_m, correlation_m, random);
  for (std::size_t i = 0; i <= steps; ++i) {
    line.nodes_m.emplace_back(point_on(placed, static_cast<double>(i) * step_m).position_m + sigma_m * noise[i]);
    line.covariance_m2.emplace_back(sigma_m * sigma_m * Eigen::Matrix3d::Identity());
  }
  return line;
}

PartChain chain_of(const std::vector<ChainBend>& bends, double closing) {
  PartChain chain;
  chain.start_m = {0.1, -0.2, 0.8};
  chain.direction = Eigen::Vector3d(1.0, 2.0, 0.5).normalized();
  chain.towards = chain.direction.unitOrthogonal();
  for (const ChainBend& bend : bends) {
    chain.bends.push_back({bend.straight_m * kTubeRadius_m, bend.rotation_rad * (M_PI / 180.0),
                           bend.angle_rad * (M_PI / 180.0), bend.radius_m * kTubeRadius_m});
  }
  chain.closing_m = closing * kTubeRadius_m;
  return chain;
}

OwnedLine line_of(const PartChain& chain, double sigma_radii, double correlation_radii, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  return noisy_line(chain, kTubeRadius_m, sigma_radii * kTubeRadius_m, correlation_radii * kTubeRadius_m, random);
}

std::string types_of(const CenterlineParts& parts) {
  std::string types;
  for (const Segment& segment : parts.segments) {
    types += segment.type == Segment::Type::straight ? 'S' : segment.type == Segment::Type::arc ? 'A' : 'F';
  }
  return types;
}

double rotation_error(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2.0 * M_PI));
}

PartChain reversed(const PartChain& chain) {
  const PlacedChain placed = place(chain);
  const ChainPoint end = point_on(placed, length_of(chain));
  PartChain back;
  back.start_m = end.position_m;
  back.direction = -end.tangent;
  back.towards = end.normal;
  back.closing_m = chain.bends.empty() ? chain.closing_m : chain.bends.front().straight_m;
  double straight_m = chain.closing_m;
  for (std::size_t i = chain.bends.size(); i-- > 0;) {
    const ChainBend& bend = chain.bends[i];
    // The plane turns the same way round, seen along the tube from either end.
    const double rotation_rad = i + 1 < chain.bends.size() ? chain.bends[i + 1].rotation_rad : 0.0;
    const bool touching = i + 1 < chain.bends.size() && chain.bends[i + 1].touching;
    back.bends.push_back({straight_m, rotation_rad, bend.angle_rad, bend.radius_m, touching});
    straight_m = bend.straight_m;
  }
  return back;
}

}  // namespace tubetrack::test
