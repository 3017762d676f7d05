#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "tubetrack/replay/scan_file.hpp"

namespace tubetrack {

/// In place of the index of a point or face.
inline constexpr std::uint32_t kNone = 0xFFFFFFFFU;

// Each of these puts a scan right and notes in scan.notes what it did.

/// Keeps of equal points the first. Returns for each of the old points its index among the new.
std::vector<std::uint32_t> merge_equal_points(std::vector<Eigen::Vector3d>& points);

/// Merges equal points; drops faces without area, faces that are there twice, and points that no face uses.
void clean_mesh(Scan& scan);

/// Turns faces over until neighbours agree, then each connected piece outward: by its signed volume where it is closed,
/// else by the side on which votes concentrate. `spacing_m`: the size of the faces.
void orient_mesh(Scan& scan, double spacing_m);

/// Merges equal points and drops those that are not finite.
void clean_cloud(Scan& scan);

/// Gives every point an outward normal. Without normals: planes through the nearest points (principal components),
/// turned toward `viewpoint_m` where there is one, else made consistent along a minimum spanning tree (Hoppe et al.
/// 1992) and turned outward by the side on which votes concentrate. Normals of the file keep their directions, and
/// their signs unless neighbours disagree.
void orient_cloud(Scan& scan, const std::optional<Eigen::Vector3d>& viewpoint_m, double spacing_m);

}  // namespace tubetrack
