#include "tubetrack/tracker/bend_table.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace tubetrack {

namespace {

// Intersections run away to infinity as a bend nears 180°.
constexpr double kLargestWhole_rad = 150.0 * std::numbers::pi / 180.0;
constexpr double kLargestRelativeSigma = 0.1;
constexpr double kLargestRotationSigma_rad = 0.1;
constexpr double kSurelyStraightSigmas = 2.0;

/// To (−π, π].
double wrapped(double angle_rad) {
  const double wrapped_rad = std::remainder(angle_rad, 2.0 * std::numbers::pi);
  return wrapped_rad <= -std::numbers::pi ? std::numbers::pi : wrapped_rad;
}

void add_intersections(const PlacedBend& bend, double angle_rad, std::vector<Eigen::Vector3d>& xyz_m) {
  const std::size_t pieces = pieces_of_bend(angle_rad);
  const double piece_rad = angle_rad / static_cast<double>(pieces);
  // The intersection lies on the bisector of its piece.
  const double from_center_m = bend.radius_m / std::cos(0.5 * piece_rad);
  for (std::size_t i = 0; i < pieces; ++i) {
    const double at_rad = (static_cast<double>(i) + 0.5) * piece_rad;
    xyz_m.emplace_back(bend.center_m +
                       from_center_m * (std::sin(at_rad) * bend.tangent - std::cos(at_rad) * bend.towards));
  }
}

bool straight_for_sure(double length_m, double sigma_m) {
  return length_m > kSurelyStraightSigmas * sigma_m;
}

BendRow row_of(const FittedChain& fitted, std::size_t i) {
  const ChainBend& bend = fitted.chain.bends[i];
  const BendSigma& sigma = fitted.sigma[i];
  BendRow row;
  row.length_m = bend.straight_m;
  row.rotation_rad = i == 0 ? 0.0 : wrapped(bend.rotation_rad);
  row.angle_rad = bend.angle_rad;
  row.bend_radius_m = bend.radius_m;
  row.length_sigma_m = sigma.straight_m;
  row.rotation_sigma_rad = sigma.rotation_rad;
  row.angle_sigma_rad = sigma.angle_rad;
  row.bend_radius_sigma_m = sigma.radius_m;
  const bool cut_in_front = i == 0 && !straight_for_sure(bend.straight_m, sigma.straight_m);
  const bool cut_behind =
      i + 1 == fitted.chain.bends.size() && !straight_for_sure(fitted.chain.closing_m, fitted.closing_sigma_m);
  // σ 0: no node decides it.
  const bool undecided = !(sigma.angle_rad > 0.0) || !(sigma.radius_m > 0.0) || (i > 0 && !(sigma.rotation_rad > 0.0));
  row.ill_conditioned =
      undecided || cut_in_front || cut_behind || !(sigma.angle_rad < kLargestRelativeSigma * bend.angle_rad) ||
      !(sigma.radius_m < kLargestRelativeSigma * bend.radius_m) || !(sigma.rotation_rad < kLargestRotationSigma_rad);
  return row;
}

bool makes_sense(const BendTable& table) {
  if (table.xyz_m.size() < 2 || table.lra.empty() || table.lra.back().angle_rad != 0.0) return false;
  for (const Eigen::Vector3d& point : table.xyz_m) {
    if (!point.allFinite()) return false;
  }
  if (!((table.xyz_m[1] - table.xyz_m[0]).norm() > 0.0)) return false;
  for (std::size_t i = 0; i < table.lra.size(); ++i) {
    const BendRow& row = table.lra[i];
    if (!(row.length_m >= 0.0) || !std::isfinite(row.length_m) || !std::isfinite(row.rotation_rad)) return false;
    if (i + 1 == table.lra.size()) break;
    if (!(row.angle_rad > 0.0) || !std::isfinite(row.angle_rad)) return false;
    if (!(row.bend_radius_m > 0.0) || !std::isfinite(row.bend_radius_m)) return false;
  }
  return true;
}

}  // namespace

std::size_t pieces_of_bend(double angle_rad) {
  return static_cast<std::size_t>(std::max(1.0, std::ceil(angle_rad / kLargestWhole_rad)));
}

void add_bends(const FittedChain& fitted, BendTable& table) {
  const PartChain& chain = fitted.chain;
  const PlacedChain placed = place(chain);
  table.xyz_m.push_back(chain.start_m);
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    add_intersections(placed.bends[i], chain.bends[i].angle_rad, table.xyz_m);
    table.lra.push_back(row_of(fitted, i));
  }
  table.xyz_m.emplace_back(placed.last_start_m + chain.closing_m * placed.last_tangent);
  BendRow closing;
  closing.length_m = chain.closing_m;
  closing.length_sigma_m = fitted.closing_sigma_m;
  closing.ill_conditioned = !straight_for_sure(chain.closing_m, fitted.closing_sigma_m);
  table.lra.push_back(closing);
}

BendTable bend_table_of(const FittedChain& fitted) {
  BendTable table;
  add_bends(fitted, table);
  return table;
}

std::optional<PartChain> chain_of(const BendTable& table) {
  if (!makes_sense(table)) return std::nullopt;
  PartChain chain;
  chain.start_m = table.xyz_m[0];
  chain.direction = (table.xyz_m[1] - table.xyz_m[0]).normalized();
  chain.towards = chain.direction.unitOrthogonal();
  if (table.xyz_m.size() > 2) {
    const Eigen::Vector3d onward = table.xyz_m[2] - table.xyz_m[1];
    const Eigen::Vector3d across = onward - onward.dot(chain.direction) * chain.direction;
    if (across.norm() > 1e-9 * onward.norm()) chain.towards = across.normalized();
  }
  for (std::size_t i = 0; i + 1 < table.lra.size(); ++i) {
    const BendRow& row = table.lra[i];
    chain.bends.push_back({row.length_m, i == 0 ? 0.0 : row.rotation_rad, row.angle_rad, row.bend_radius_m});
  }
  chain.closing_m = table.lra.back().length_m;
  return chain;
}

std::vector<Eigen::Vector3d> centerline_of(const BendTable& table, double step_m) {
  const std::optional<PartChain> chain = chain_of(table);
  return chain ? points_along(*chain, step_m) : std::vector<Eigen::Vector3d>();
}

}  // namespace tubetrack
