#include "scan_result.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack {

namespace {

/// A height map shows nothing steeper than 75°, and of what a camera sees from one side 90° or so are left. Of a box it
/// shows the top alone, so that there is no rounded edge to be taken for a tube.
constexpr double kHeightMapArc_rad = 1.6;

}  // namespace

Expected<TubeFrame> tubes_of_scan(const Scan& scan, std::span<const ScanSurfel> surfels, ScanTubesConfig& config,
                                  bool any_radius) {
  config.grid_step_m = scan.grid_step_m;
  if (scan.kind == ScanKind::height_map) config.min_arc_rad = kHeightMapArc_rad;
  if (any_radius) {
    const RadiusRange range = default_radius_range(scan, surfels);
    config.radius_min_m = range.min_m;
    config.radius_max_m = range.max_m;
  }
  if (auto valid = validate(config); !valid) return tl::make_unexpected(valid.error());
  TubeFrame frame = find_scan_tubes(surfels, config);
  const Eigen::Isometry3d pose = scan.pose * Eigen::Translation3d(scan.origin_m);
  for (Tube& tube : frame.tubes) {
    for (Eigen::Vector3d& point : tube.centerline_m) point = pose * point;
    for (Eigen::Vector3d& point : tube.bend_table.xyz_m) point = pose * point;
    for (Eigen::Matrix3d& covariance : tube.node_covariance_m2)
      covariance = pose.linear() * covariance * pose.linear().transpose();
  }
  return frame;
}

void print_tubes(std::span<const Tube> tubes) {
  for (const Tube& tube : tubes) {
    fmt::print(stderr, "tube {}: {}radius {:.3f} ± {:.3f} mm", tube.id, tube.closed ? "closed, " : "",
               1e3 * tube.radius_m, 1e3 * tube.radius_sigma_m);
    if (!tube.node_radius_m.empty()) {
      const auto [least, most] = std::ranges::minmax_element(tube.node_radius_m);
      fmt::print(stderr, " on average, {:.3f} to {:.3f} along it", 1e3 * *least, 1e3 * *most);
    }
    fmt::print(stderr, ", length {:.1f} mm", 1e3 * tube.length_m);
    int arcs = 0, straights = 0, free = 0;
    for (const Segment& segment : tube.segments) {
      arcs += segment.type == Segment::Type::arc ? 1 : 0;
      straights += segment.type == Segment::Type::straight ? 1 : 0;
      free += segment.type == Segment::Type::free ? 1 : 0;
    }
    fmt::print(stderr, ", {} straight, {} toric, {} free\n", straights, arcs, free);
  }
}

}  // namespace tubetrack
