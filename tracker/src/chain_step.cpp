#include "chain_step.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "chain_residual.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

// A step may not go farther: rad, or by this factor's logarithm.
constexpr double kLargestStep = 0.5;
constexpr double kLeastAngle_rad = 0.004;

}  // namespace

void ChainEquations::pin(Eigen::Index k, double step) {
  gradient -= step * normal.col(k);
  normal.row(k).setZero();
  normal.col(k).setZero();
  normal(k, k) = 1.0;
  gradient[k] = step;
}

int hold_undecided(const PartChain& chain, ChainEquations& equations) {
  const double least = 1e-12 * equations.normal.diagonal().maxCoeff();
  int free = 0;
  const auto hold = [&](Eigen::Index k, bool held) {
    if (held || !(equations.normal(k, k) > least)) {
      equations.pin(k, 0.0);
    } else {
      ++free;
    }
  };
  for (Eigen::Index k = 0; k < kStartParameters; ++k) hold(k, false);
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    const Eigen::Index straight = place_of(i, BendParameter::straight);
    hold(straight,
         chain.bends[i].touching || (chain.bends[i].straight_m <= 0.0 && equations.gradient[straight] <= 0.0));
    for (Eigen::Index k = straight + 1; k < straight + kBendParameters; ++k) hold(k, false);
  }
  return free;
}

RecycledMatrix solved(const RecycledMatrix& normal, const RecycledMatrix& right) {
  constexpr int kUsual = 64;
  using Usual = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kUsual, kUsual>;
  if (normal.rows() <= kUsual) return Eigen::LDLT<Usual>(normal).solve(right);
  return Eigen::LDLT<Eigen::MatrixXd>(normal).solve(right);
}

RecycledColumn solve(const PartChain& chain, ChainEquations& equations) {
  RecycledColumn step = solved(equations.normal, equations.gradient).col(0);
  for (std::size_t round = 0; round < chain.bends.size(); ++round) {
    bool held = false;
    for (std::size_t i = 0; i < chain.bends.size(); ++i) {
      const Eigen::Index k = place_of(i, BendParameter::straight);
      if (chain.bends[i].straight_m + step[k] >= -1e-12) continue;
      equations.pin(k, -chain.bends[i].straight_m);
      held = true;
    }
    if (!held) break;
    step = solved(equations.normal, equations.gradient).col(0);
  }
  return step;
}

void move_chain(PartChain& chain, const RecycledColumn& step) {
  const Eigen::Vector3d side = chain.direction.cross(chain.towards);
  chain.start_m += step[0] * chain.towards + step[1] * side;
  const Eigen::Vector3d turn = step[2] * chain.towards + step[3] * side;
  const double angle = turn.norm();
  if (angle > 0.0) {
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
    chain.direction = (rotation * chain.direction).normalized();
    chain.towards = rotation * chain.towards;
  }
  chain.towards = (chain.towards - chain.towards.dot(chain.direction) * chain.direction).normalized();
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    ChainBend& bend = chain.bends[i];
    const auto limited = [&](BendParameter parameter) {
      return std::clamp(step[place_of(i, parameter)], -kLargestStep, kLargestStep);
    };
    bend.straight_m = std::max(0.0, bend.straight_m + step[place_of(i, BendParameter::straight)]);
    bend.rotation_rad += limited(BendParameter::rotation);
    bend.radius_m *= std::exp(limited(BendParameter::log_radius));
    bend.angle_rad = std::max(kLeastAngle_rad, bend.angle_rad + limited(BendParameter::angle));
  }
}

}  // namespace tubetrack
