#include "chain_residual.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

// Nodes are not trusted farther than this, in radii: a bender's bends and a sensor's bias are no better.
constexpr double kFloorRadii = 0.01;
// Newton steps to a node's foot, and the move, in radii, after which none more is needed.
constexpr int kFootSteps = 4;
constexpr double kFootRadii = 0.1;

Carry turn_about(const Eigen::Vector3d& axis, const Eigen::Vector3d& through) {
  return {axis, through.cross(axis), 0.0};
}

/// Inside an arc its radius moves a point away from the arc's start, at the point's own angle.
Carry radius_inside(const PlacedBend& bend, const Eigen::Vector3d& start_m) {
  return {Eigen::Vector3d::Zero(), -(bend.arc_start_m - start_m), 1.0};
}

/// The whitened directions' derivatives by all parameters.
void fill_rows(const Probe& probe, const PlacedChain& placed, const PartChain& chain,
               const RecycledVector<Carry>& carries, Eigen::Ref<Eigen::MatrixXd> rows) {
  const Eigen::Vector3d arm = probe.point.position_m - chain.start_m;
  Eigen::Matrix<double, 3, 2> moment;
  moment.col(0) = arm.cross(probe.along.row(0).transpose());
  moment.col(1) = arm.cross(probe.along.row(1).transpose());
  const auto put = [&](Eigen::Index column, const Carry& carry) {
    rows.col(column) = probe.along * (carry.shift + carry.stretch * arm) + moment.transpose() * carry.turn;
  };
  const Eigen::Index behind = place_of(probe.point.bend, BendParameter::straight);
  for (Eigen::Index k = 0; k < behind; ++k) put(k, carries[static_cast<std::size_t>(k)]);
  if (!probe.point.in_arc) return;
  const Eigen::Index rotation = place_of(probe.point.bend, BendParameter::rotation);
  put(behind, carries[static_cast<std::size_t>(behind)]);
  put(rotation, carries[static_cast<std::size_t>(rotation)]);
  put(place_of(probe.point.bend, BendParameter::log_radius),
      radius_inside(placed.bends[probe.point.bend], chain.start_m));
}

}  // namespace

double nearer_foot(const PlacedChain& placed, const Eigen::Vector3d& node_m, double foot_m, double radius_m) {
  for (int step = 0; step < kFootSteps; ++step) {
    const ChainPoint point = point_on(placed, foot_m);
    const Eigen::Vector3d off_m = node_m - point.position_m;
    const double slope = std::max(0.3, 1.0 - point.curvature_per_m * point.normal.dot(off_m));
    const double move_m = std::clamp(point.tangent.dot(off_m) / slope, -4.0 * radius_m, 4.0 * radius_m);
    foot_m += move_m;
    if (std::abs(move_m) < kFootRadii * radius_m) break;
  }
  return foot_m;
}

void PartSums::add(const ChainPoint& point, const Eigen::Vector3d& along, const PlacedChain& placed,
                   const Eigen::Vector3d& start_m, double weight, double residual_m) {
  Row row;
  row.head<3>() = along;
  row.segment<3>(3) = (point.position_m - start_m).cross(along);
  row[6] = point.in_arc ? along.dot(point.position_m - placed.bends[point.bend].arc_start_m) : 0.0;
  row[7] = 1.0;
  normal.noalias() += (weight * row) * row.transpose();
  gradient += (weight * residual_m) * row;
}

void put_together(const std::vector<PartSums>& parts, const RecycledVector<Carry>& carries, RecycledMatrix& normal,
                  RecycledColumn& gradient) {
  using Move = Eigen::Matrix<double, 6, 1>;
  const auto last = static_cast<Eigen::Index>(carries.size());  // the radius
  normal.setZero(last + 1, last + 1);
  gradient.setZero(last + 1);
  const auto move = [&](Eigen::Index k) {
    const Carry& carry = carries[static_cast<std::size_t>(k)];
    return Move((Move() << carry.shift, carry.turn).finished());
  };
  // A parameter carries all that lies behind it alike, as those before it do: with the sums over that it is one
  // product.
  PartSums behind = parts.back();
  const auto put = [&](Eigen::Index k) {
    const Move own = move(k);
    const PartSums::Row pull = behind.normal.leftCols<6>() * own;
    for (Eigen::Index i = 0; i <= k; ++i) normal(i, k) += move(i).dot(pull.head<6>());
    normal(k, last) += pull[7];
    gradient[k] += own.dot(behind.gradient.head<6>());
  };
  const auto add = [&](const PartSums& part) {
    behind.normal += part.normal;
    behind.gradient += part.gradient;
  };
  for (std::size_t bend = parts.size() / 2; bend-- > 0;) {
    const PartSums& arc = parts[2 * bend + 1];
    const Eigen::Index radius = place_of(bend, BendParameter::log_radius);
    put(place_of(bend, BendParameter::angle));
    put(radius);
    add(arc);
    put(place_of(bend, BendParameter::rotation));
    put(place_of(bend, BendParameter::straight));
    // Inside the arc its radius moves points by how far in they are.
    for (Eigen::Index i = 0; i < radius; ++i) normal(i, radius) += move(i).dot(arc.normal.col(6).head<6>());
    normal(radius, radius) += arc.normal(6, 6);
    normal(radius, last) += arc.normal(6, 7);
    gradient[radius] += arc.gradient[6];
    add(parts[2 * bend]);
  }
  for (Eigen::Index k = 0; k < kStartParameters; ++k) put(k);
  normal(last, last) = behind.normal(7, 7);
  gradient[last] = behind.gradient[7];
  normal.triangularView<Eigen::StrictlyLower>() = normal.transpose();
}

Eigen::Index parameter_count(const PartChain& chain) {
  return kStartParameters + kBendParameters * static_cast<Eigen::Index>(chain.bends.size());
}

RecycledVector<Carry> carries_of(const PlacedChain& placed, const PartChain& chain) {
  const Eigen::Vector3d& start = chain.start_m;
  const Eigen::Vector3d side = chain.direction.cross(chain.towards);
  RecycledVector<Carry> carries = {{Eigen::Vector3d::Zero(), chain.towards, 0.0},
                                   {Eigen::Vector3d::Zero(), side, 0.0},
                                   {chain.towards, Eigen::Vector3d::Zero(), 0.0},
                                   {side, Eigen::Vector3d::Zero(), 0.0}};
  for (std::size_t i = 0; i < placed.bends.size(); ++i) {
    const PlacedBend& bend = placed.bends[i];
    const Eigen::Vector3d end =
        i + 1 < placed.bends.size() ? placed.bends[i + 1].straight_start_m : placed.last_start_m;
    carries.push_back({Eigen::Vector3d::Zero(), bend.tangent, 0.0});
    carries.push_back(turn_about(bend.tangent, bend.arc_start_m - start));
    carries.push_back({Eigen::Vector3d::Zero(), end - bend.arc_start_m, 0.0});
    carries.push_back(turn_about(bend.axis, bend.center_m - start));
  }
  return carries;
}

Probe probe_of(const PlacedChain& placed, const MeasuredCenterline& line, std::size_t node, double foot_m) {
  Probe probe;
  probe.point = point_on(placed, foot_m);
  Eigen::Matrix<double, 2, 3> across;
  across.row(0) = probe.point.normal;
  across.row(1) = probe.point.tangent.cross(probe.point.normal);
  const double floor_m = kFloorRadii * line.radius_m;
  Eigen::Matrix2d section = across * line.covariance_m2[node] * across.transpose();
  section.diagonal().array() += floor_m * floor_m;
  // The inverse of the section's Cholesky factor, by hand: it is 2 × 2.
  const double a = std::sqrt(section(0, 0));
  const double b = section(1, 0) / a;
  const double c = std::sqrt(std::max(section(1, 1) - b * b, floor_m * floor_m));
  probe.along.row(0) = across.row(0) / a;
  probe.along.row(1) = (across.row(1) - b * probe.along.row(0)) / c;
  probe.residual = probe.along * (line.nodes_m[node] - probe.point.position_m);
  return probe;
}

double evaluate(const PartChain& chain, const MeasuredCenterline& line, RecycledVector<double>& foot_m,
                RecycledColumn& residual, RecycledMatrix& jacobian) {
  const PlacedChain placed = place(chain);
  const RecycledVector<Carry> carries = carries_of(placed, chain);
  residual.resize(2 * static_cast<Eigen::Index>(line.nodes_m.size()));
  jacobian.setZero(residual.size(), parameter_count(chain));
  for (std::size_t i = 0; i < line.nodes_m.size(); ++i) {
    foot_m[i] = nearer_foot(placed, line.nodes_m[i], foot_m[i], line.radius_m);
    const Probe probe = probe_of(placed, line, i, foot_m[i]);
    const Eigen::Index row = 2 * static_cast<Eigen::Index>(i);
    residual.segment<2>(row) = probe.residual;
    fill_rows(probe, placed, chain, carries, jacobian.middleRows(row, 2));
  }
  return residual.squaredNorm();
}

}  // namespace tubetrack
