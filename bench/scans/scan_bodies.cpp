#include "scan_bodies.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tubetrack::bench {

namespace {

/// A ring's axes across the tube: carried along without a turn, or with the first pointing to the viewer.
void turn_frame(const ChainPoint& at, const ScanOfTube& how, Eigen::Vector3d& e1) {
  const bool whole = how.section_rad > 6.28;
  if (!whole) e1 = how.seen_from;
  e1 -= e1.dot(at.tangent) * at.tangent;
  e1 = e1.norm() > 1e-3 ? Eigen::Vector3d(e1.normalized()) : Eigen::Vector3d(at.tangent.unitOrthogonal());
}

Eigen::AlignedBox3d box_of(const std::vector<Eigen::Vector3d>& line_m, double margin_m) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point_m : line_m) box.extend(point_m);
  box.min().array() -= margin_m;
  box.max().array() += margin_m;
  return box;
}

}  // namespace

Scan mesh_of_tube(const PartChain& chain, const ScanOfTube& how, std::mt19937_64& random) {
  Scan scan;
  const PlacedChain placed = place(chain);
  const double length_m = length_of(chain);
  const bool whole = how.section_rad > 6.28;
  const int rings = std::max(2, static_cast<int>(std::lround(length_m / how.step_m)));
  const int around = std::max(3, static_cast<int>(std::lround(how.section_rad * how.radius_m / how.step_m)));
  const int columns = whole ? around : around + 1;
  std::normal_distribution<double> noise(0.0, how.noise_m > 0.0 ? how.noise_m : 1.0);
  Eigen::Vector3d e1 = placed.last_towards;
  std::vector<Eigen::Vector3d> outward;  // of each point, without noise
  const int last_ring = how.closed ? rings - 1 : rings;
  const auto points = static_cast<std::size_t>(last_ring + 1) * static_cast<std::size_t>(columns);
  outward.reserve(points);
  scan.points_m.reserve(points);
  scan.faces.reserve(2 * static_cast<std::size_t>(how.closed ? rings : last_ring) * static_cast<std::size_t>(around));
  for (int i = 0; i <= last_ring; ++i) {
    const ChainPoint at = point_on(placed, length_m * i / rings);
    turn_frame(at, how, e1);
    const Eigen::Vector3d e2 = at.tangent.cross(e1);
    for (int k = 0; k < columns; ++k) {
      const double angle = how.section_rad * (static_cast<double>(k) / around - (whole ? 0.0 : 0.5));
      const double r = how.radius_m + (how.noise_m > 0.0 ? noise(random) : 0.0);
      outward.emplace_back(std::cos(angle) * e1 + std::sin(angle) * e2);
      scan.points_m.emplace_back(at.position_m + r * outward.back());
    }
  }
  const auto index = [&](int i, int k) {
    return static_cast<std::uint32_t>((i % (last_ring + 1)) * columns + k % columns);
  };
  const auto add_face = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    if (!how.one_side || (outward[a] + outward[b] + outward[c]).dot(how.seen_from) > 0.0)
      scan.faces.push_back({a, b, c});
  };
  const int ring_count = how.closed ? rings : last_ring;
  for (int i = 0; i < ring_count; ++i) {
    for (int k = 0; k < around; ++k) {
      const std::uint32_t a = index(i, k), b = index(i, k + 1), c = index(i + 1, k), d = index(i + 1, k + 1);
      add_face(a, b, d);
      add_face(a, d, c);
    }
  }
  scan.grid_step_m = default_grid_step_m(scan);
  return scan;
}

Scan voxels_of_tube(const PartChain& chain, const ScanOfTube& how) {
  Scan scan;
  scan.kind = ScanKind::voxels;
  const std::vector<Eigen::Vector3d> line_m = points_along(chain, 0.1 * how.radius_m);
  const Eigen::AlignedBox3d box = box_of(line_m, how.radius_m + 3.0 * how.step_m);
  VoxelGrid& grid = scan.voxels;
  grid.origin_m = box.min();
  grid.axes_m = how.step_m * Eigen::Matrix3d::Identity();
  grid.size = (box.diagonal() / how.step_m).array().ceil().cast<int>();
  grid.inside.assign(static_cast<std::size_t>(grid.size.x()) * static_cast<std::size_t>(grid.size.y()) *
                         static_cast<std::size_t>(grid.size.z()),
                     0);
  for (const Eigen::Vector3d& center_m : line_m) {
    const Eigen::Vector3d at = (center_m - grid.origin_m) / how.step_m;
    const double reach = how.radius_m / how.step_m;
    const Eigen::Vector3i low = (at.array() - reach).ceil().cast<int>(),
                          high = (at.array() + reach).floor().cast<int>();
    for (int k = low.z(); k <= high.z(); ++k) {
      for (int j = low.y(); j <= high.y(); ++j) {
        for (int i = low.x(); i <= high.x(); ++i) {
          if ((Eigen::Vector3d(i, j, k) - at).squaredNorm() < reach * reach) grid.inside[grid.at(i, j, k)] = 1;
        }
      }
    }
  }
  scan.grid_step_m = how.step_m;
  return scan;
}

Scan heights_of_tube(const PartChain& chain, const ScanOfTube& how) {
  Scan scan;
  scan.kind = ScanKind::height_map;
  const std::vector<Eigen::Vector3d> line_m = points_along(chain, 0.05 * how.radius_m);
  const Eigen::AlignedBox3d box = box_of(line_m, how.radius_m + 3.0 * how.step_m);
  HeightGrid& grid = scan.heights;
  grid.cell_size_m = how.step_m;
  grid.width = static_cast<int>(std::ceil(box.max().x() / how.step_m));
  grid.height = static_cast<int>(std::ceil(box.max().y() / how.step_m));
  grid.height_m.assign(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height),
                       std::numeric_limits<float>::quiet_NaN());
  for (const Eigen::Vector3d& center_m : line_m) {
    const double reach = how.radius_m / how.step_m;
    const double x = center_m.x() / how.step_m, y = center_m.y() / how.step_m;
    for (int v = std::max(0, static_cast<int>(std::ceil(y - reach))); v <= std::min(y + reach, grid.height - 1.0);
         ++v) {
      for (int u = std::max(0, static_cast<int>(std::ceil(x - reach))); u <= std::min(x + reach, grid.width - 1.0);
           ++u) {
        const double squared = reach * reach - (u - x) * (u - x) - (v - y) * (v - y);
        if (squared < 0.0) continue;
        const auto height = static_cast<float>(-center_m.z() + how.step_m * std::sqrt(squared));
        float& cell = grid.height_m[static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) +
                                    static_cast<std::size_t>(u)];
        if (!(cell >= height)) cell = height;
      }
    }
  }
  scan.grid_step_m = how.step_m;
  return scan;
}

double distance_from(const std::vector<Eigen::Vector3d>& line_m, const Eigen::Vector3d& point_m) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < line_m.size(); ++i) {
    const Eigen::Vector3d along = line_m[i] - line_m[i - 1];
    const double share = std::clamp((point_m - line_m[i - 1]).dot(along) / along.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (line_m[i - 1] + share * along - point_m).squaredNorm());
  }
  return std::sqrt(least);
}

LineError error_of(const std::vector<Eigen::Vector3d>& nodes_m, const PartChain& chain) {
  // A rounded end goes on beyond the chain's: what counts is how far a node is off sideways.
  PartChain longer = chain;
  constexpr double kBeyond_m = 0.02;
  if (!chain.bends.empty() && chain.bends.front().straight_m > 0.0) {
    longer.start_m -= kBeyond_m * chain.direction;
    longer.bends.front().straight_m += kBeyond_m;
    longer.closing_m += kBeyond_m;
  }
  // On a long chain nodes follow each other, and each is looked for around the place of the one before.
  const double step_m = std::min(length_of(longer) / 5000.0, 0.002);
  const std::vector<Eigen::Vector3d> truth_m = points_along(longer, step_m);
  constexpr std::size_t kLong = 20'000, kAround = 100;
  const std::size_t around = truth_m.size() > kLong ? kAround : truth_m.size();
  std::size_t place = 0, from = 0, to = truth_m.size();
  LineError error;
  for (const Eigen::Vector3d& node_m : nodes_m) {
    const auto nearest = std::min_element(truth_m.begin() + static_cast<std::ptrdiff_t>(from),
                                          truth_m.begin() + static_cast<std::ptrdiff_t>(to),
                                          [&](const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
                                            return (p - node_m).squaredNorm() < (q - node_m).squaredNorm();
                                          });
    place = static_cast<std::size_t>(nearest - truth_m.begin());
    from = place > around ? place - around : 0;
    to = std::min(place + around, truth_m.size());
    const std::size_t first = place > 1 ? place - 2 : 0, end = std::min(place + 3, truth_m.size());
    const std::vector<Eigen::Vector3d> near_m(truth_m.begin() + static_cast<std::ptrdiff_t>(first),
                                              truth_m.begin() + static_cast<std::ptrdiff_t>(end));
    const double off_m = distance_from(near_m, node_m);
    error.rms_m += off_m * off_m;
    error.max_m = std::max(error.max_m, off_m);
  }
  error.rms_m = std::sqrt(error.rms_m / static_cast<double>(nodes_m.size()));
  return error;
}

}  // namespace tubetrack::bench
