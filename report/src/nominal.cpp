#include "tubetrack/report/nominal.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "tubetrack/tracker/bend_table.hpp"

namespace tubetrack {

namespace {

using Points = std::vector<Eigen::Vector3d>;

/// The bend radius at each inner XYZ point; a bend that counts as two halves has it twice.
std::vector<double> radii_of(const BendTable& table) {
  std::vector<double> radii_m;
  for (std::size_t i = 0; i + 1 < table.lra.size(); ++i)
    radii_m.insert(radii_m.end(), pieces_of_bend(table.lra[i].angle_rad), table.lra[i].bend_radius_m);
  return radii_m;
}

double angle_at(const Points& xyz_m, std::size_t k) {
  const Eigen::Vector3d in = xyz_m[k] - xyz_m[k - 1], out = xyz_m[k + 1] - xyz_m[k];
  return std::atan2(in.cross(out).norm(), in.dot(out));
}

/// The ends, and where bends of these radii begin and end.
Points tangent_points(const Points& xyz_m, const std::vector<double>& radii_m) {
  Points points_m{xyz_m.front()};
  for (std::size_t k = 1; k + 1 < xyz_m.size(); ++k) {
    const double reach_m = radii_m[k - 1] * std::tan(0.5 * angle_at(xyz_m, k));
    points_m.emplace_back(xyz_m[k] - reach_m * (xyz_m[k] - xyz_m[k - 1]).normalized());
    points_m.emplace_back(xyz_m[k] + reach_m * (xyz_m[k + 1] - xyz_m[k]).normalized());
  }
  points_m.push_back(xyz_m.back());
  return points_m;
}

/// The centreline as a polyline, arcs in steps of half a degree (a micrometre off at 100 mm), ends drawn out.
Points centerline_through(const Points& xyz_m, const std::vector<double>& radii_m, double beyond_m) {
  const Points tangent_m = tangent_points(xyz_m, radii_m);
  Points line_m{xyz_m.front() - beyond_m * (xyz_m[1] - xyz_m[0]).normalized()};
  for (std::size_t k = 1; k + 1 < xyz_m.size(); ++k) {
    const Eigen::Vector3d& from_m = tangent_m[2 * k - 1];
    const Eigen::Vector3d along = (xyz_m[k] - xyz_m[k - 1]).normalized();
    const Eigen::Vector3d out = (xyz_m[k + 1] - xyz_m[k]).normalized();
    const Eigen::Vector3d towards = (out - out.dot(along) * along).normalized();
    const double angle_rad = angle_at(xyz_m, k), radius_m = radii_m[k - 1];
    constexpr double kStep_rad = 0.0087;
    const int steps = std::max(1, static_cast<int>(std::ceil(angle_rad / kStep_rad)));
    for (int i = 0; i <= steps; ++i) {
      const double turned = angle_rad * i / steps;
      line_m.emplace_back(from_m + radius_m * (std::sin(turned) * along + (1.0 - std::cos(turned)) * towards));
    }
  }
  line_m.emplace_back(xyz_m.back() + beyond_m * (xyz_m.back() - xyz_m[xyz_m.size() - 2]).normalized());
  return line_m;
}

double distance_m(const Points& line_m, const Eigen::Vector3d& point_m) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < line_m.size(); ++i) {
    const Eigen::Vector3d along = line_m[i] - line_m[i - 1];
    const double squared = along.squaredNorm();
    const double share = squared > 0.0 ? std::clamp((point_m - line_m[i - 1]).dot(along) / squared, 0.0, 1.0) : 0.0;
    least = std::min(least, (line_m[i - 1] + share * along - point_m).squaredNorm());
  }
  return std::sqrt(least);
}

Eigen::Isometry3d best_motion(const Points& from_m, const Points& to_m) {
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(from_m.size())), to = from;
  for (std::size_t i = 0; i < from_m.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = from_m[i];
    to.col(static_cast<Eigen::Index>(i)) = to_m[i];
  }
  return Eigen::Isometry3d(Eigen::umeyama(from, to, false));
}

NominalComparison compare(const NominalTube& nominal, const Tube& tube, bool reversed) {
  NominalComparison comparison;
  comparison.nominal = nominal.id;
  comparison.tube = tube.id;
  comparison.reversed = reversed;
  // The measured tube is turned to the nominal one's order.
  Points measured_xyz_m = tube.bend_table.xyz_m;
  std::vector<double> radii_m = radii_of(tube.bend_table);
  if (reversed) {
    std::reverse(measured_xyz_m.begin(), measured_xyz_m.end());
    std::reverse(radii_m.begin(), radii_m.end());
  }
  const Points measured_m = tangent_points(measured_xyz_m, radii_m);
  const Eigen::Isometry3d motion = best_motion(tangent_points(nominal.xyz_m, radii_m), measured_m);
  Points nominal_xyz_m;
  for (const Eigen::Vector3d& point_m : nominal.xyz_m) nominal_xyz_m.emplace_back(motion * point_m);
  const Points nominal_m = tangent_points(nominal_xyz_m, radii_m);
  constexpr double kBeyondRadii = 20.0;
  const Points sheath_m = centerline_through(nominal_xyz_m, radii_m, kBeyondRadii * tube.radius_m);
  for (std::size_t i = 0; i < measured_m.size(); ++i) {
    using At = NominalPoint::At;
    const At at = i == 0                       ? At::start
                  : i + 1 == measured_m.size() ? At::end
                  : i % 2 == 1                 ? At::before_bend
                                               : At::behind_bend;
    const double deviation_m = (measured_m[i] - nominal_m[i]).norm();
    comparison.points.push_back({at, (i + 1) / 2, deviation_m, distance_m(sheath_m, measured_m[i])});
    comparison.rms_m += deviation_m * deviation_m / static_cast<double>(measured_m.size());
    comparison.max_deviation_m = std::max(comparison.max_deviation_m, deviation_m);
  }
  comparison.rms_m = std::sqrt(comparison.rms_m);
  for (const Eigen::Vector3d& point_m : centerline_of(tube.bend_table, 0.25 * tube.radius_m))
    comparison.max_sheath_m = std::max(comparison.max_sheath_m, distance_m(sheath_m, point_m));
  return comparison;
}

std::string why_none(const NominalTube& nominal, std::span<const Tube> tubes) {
  std::string found;
  for (const Tube& tube : tubes) {
    found += fmt::format(
        "{}tube {} has {}", found.empty() ? "" : ", ", tube.id,
        tube.bend_table.xyz_m.empty() ? "no bend table" : fmt::format("{} XYZ points", tube.bend_table.xyz_m.size()));
  }
  return fmt::format("no tube left with {} XYZ points: {}", nominal.xyz_m.size(), found.empty() ? "none found" : found);
}

}  // namespace

std::vector<NominalComparison> compare_with_nominal(std::span<const NominalTube> nominal, std::span<const Tube> tubes) {
  std::vector<NominalComparison> comparisons;
  std::vector<bool> taken(tubes.size(), false);
  for (const NominalTube& wanted : nominal) {
    std::optional<NominalComparison> best;
    std::size_t best_tube = 0;
    for (std::size_t i = 0; i < tubes.size(); ++i) {
      if (taken[i] || wanted.xyz_m.size() < 2 || tubes[i].bend_table.xyz_m.size() != wanted.xyz_m.size()) continue;
      if (radii_of(tubes[i].bend_table).size() + 2 != wanted.xyz_m.size()) continue;
      for (const bool reversed : {false, true}) {
        NominalComparison comparison = compare(wanted, tubes[i], reversed);
        if (best && best->rms_m <= comparison.rms_m) continue;
        best = std::move(comparison);
        best_tube = i;
      }
    }
    if (best) {
      taken[best_tube] = true;
      comparisons.push_back(std::move(*best));
    } else {
      comparisons.emplace_back();
      comparisons.back().nominal = wanted.id;
      comparisons.back().problem = why_none(wanted, tubes);
    }
  }
  return comparisons;
}

std::string_view nominal_point_name(NominalPoint::At at) {
  switch (at) {
    case NominalPoint::At::start:
      return "start";
    case NominalPoint::At::before_bend:
      return "before_bend";
    case NominalPoint::At::behind_bend:
      return "behind_bend";
    default:
      return "end";
  }
}

}  // namespace tubetrack
