#include "random_tubes.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "dice.hpp"

namespace tubetrack::bench {

namespace {

using std::numbers::pi;

PartChain random_chain(Dice& dice, int bends, double radius_m) {
  const double diameter_m = 2.0 * radius_m;
  PartChain chain;
  chain.start_m = {dice.uniform(-0.1, 0.1), dice.uniform(-0.1, 0.1), dice.uniform(-0.1, 0.1)};
  chain.direction = dice.direction();
  chain.towards = chain.direction.unitOrthogonal();
  chain.towards = Eigen::AngleAxisd(dice.uniform(-pi, pi), chain.direction) * chain.towards;
  for (int i = 0; i < bends; ++i) {
    const double straight_m = diameter_m * dice.uniform(1.0, 6.0);
    const double rotation_rad = i == 0 ? 0.0 : dice.uniform(-pi, pi);
    const double angle_rad = pi * dice.uniform(1.0 / 6.0, 1.0);
    chain.bends.push_back({straight_m, rotation_rad, angle_rad, diameter_m * dice.uniform(1.5, 10.0)});
  }
  chain.closing_m = diameter_m * dice.uniform(1.0, 6.0);
  return chain;
}

/// Whether two places of the line that are not beside each other along it are too near.
bool comes_back_to_itself(const PartChain& chain, double radius_m) {
  const double step_m = 0.25 * radius_m;
  const std::vector<Eigen::Vector3d> line_m = points_along(chain, step_m);
  const double near_m = 2.25 * radius_m;
  // Half a turn of the tightest bend, of radius 3 R, is this long; what is nearer along the tube cannot touch.
  const auto beside = static_cast<std::size_t>(pi * radius_m / step_m);
  for (std::size_t i = 0; i < line_m.size(); ++i) {
    for (std::size_t k = i + beside; k < line_m.size(); ++k) {
      if ((line_m[i] - line_m[k]).squaredNorm() < near_m * near_m) return true;
    }
  }
  return false;
}

/// Across which the line reaches least far: a tube put down on a floor is seen so from above.
Eigen::Vector3d flattest(const PartChain& chain, double radius_m) {
  const std::vector<Eigen::Vector3d> line_m = points_along(chain, radius_m);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : line_m) mean += point / static_cast<double>(line_m.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : line_m) spread += (point - mean) * (point - mean).transpose();
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
}

}  // namespace

RandomTube random_tube(std::uint64_t seed) {
  Dice dice("random tubes", seed);
  RandomTube tube;
  tube.radius_m = dice.uniform(0.004, 0.015);
  tube.step_m = tube.radius_m / dice.uniform(6.0, 10.0);
  const int bends = 1 + dice.pick(6);
  do {
    tube.chain = random_chain(dice, bends, tube.radius_m);
  } while (comes_back_to_itself(tube.chain, tube.radius_m));
  tube.seen_from = flattest(tube.chain, tube.radius_m);
  return tube;
}

}  // namespace tubetrack::bench
