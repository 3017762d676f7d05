#include "tubetrack/replay/scan_surfels.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "grid_surfels.hpp"

namespace tubetrack {

namespace {

using Triangle = std::array<Eigen::Vector3d, 3>;

/// The corner from which the longest edge runs to the next one.
std::size_t longest_edge(const Triangle& triangle, double& squared) {
  std::size_t longest = 0;
  squared = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double edge = (triangle[(k + 1) % 3] - triangle[k]).squaredNorm();
    if (edge <= squared) continue;
    squared = edge;
    longest = k;
  }
  return longest;
}

/// An upper bound of the pieces that faces are cut into.
double pieces_at_most(const Scan& scan, double limit_m) {
  double count = 0.0;
  for (const auto& [a, b, c] : scan.faces) {
    const Triangle triangle{scan.points_m[a], scan.points_m[b], scan.points_m[c]};
    double squared = 0.0;
    longest_edge(triangle, squared);
    count += 1.0;
    if (squared <= limit_m * limit_m) continue;
    const double area = 0.5 * (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).norm();
    count += 2.0 * std::sqrt(squared) / limit_m + 8.0 * area / (limit_m * limit_m);
  }
  return count;
}

/// The longest edge that a piece of a face may have: two grid steps, or more where that made too many pieces.
double piece_limit_m(const Scan& scan, std::size_t max_count, double longest_m2) {
  double limit_m = 2.0 * scan.grid_step_m;
  if (!(limit_m > 0.0) || scan.faces.size() >= max_count) return std::numeric_limits<double>::infinity();
  while (longest_m2 > limit_m * limit_m && pieces_at_most(scan, limit_m) > static_cast<double>(max_count))
    limit_m *= 2.0;
  return limit_m;
}

/// Normals at a mesh's points: sums of their faces' ones, weighted by area; zero where no face is. `longest_m2`: gets
/// the square of the longest edge.
std::vector<Eigen::Vector3d> normals_at_points(const Scan& scan, double& longest_m2) {
  longest_m2 = 0.0;
  std::vector<Eigen::Vector3d> normals(scan.points_m.size(), Eigen::Vector3d::Zero());
  for (const auto& [a, b, c] : scan.faces) {
    const Eigen::Vector3d to_b = scan.points_m[b] - scan.points_m[a], to_c = scan.points_m[c] - scan.points_m[a];
    const Eigen::Vector3d twice_area = to_b.cross(to_c);
    longest_m2 = std::max(
        {longest_m2, to_b.squaredNorm(), to_c.squaredNorm(), (scan.points_m[c] - scan.points_m[b]).squaredNorm()});
    for (const std::uint32_t corner : {a, b, c}) normals[corner] += twice_area;
  }
  for (Eigen::Vector3d& normal : normals) normal.normalize();
  return normals;
}

/// A face, and how far the surface whose corners it has stands out over it. A flat face lies inside a round tube, by a
/// fiftieth of a grid step where its radius is six of them, and a bend of flat faces inside its circle.
struct Face {
  Triangle corners;
  Eigen::Vector3d normal;  ///< outward, unit
  double twice_area = 0.0;
  std::array<Eigen::Vector3d, 3> normals;  ///< at the corners; zero at an edge of the body, which is not round

  /// Of a point of the face, along its normal: on a surface of constant curvature K a corner d away has the normal
  /// n + K d and lies d · K d / 2 below the tangent plane; weighted by the corners' shares in the point.
  double stands_out_m(const Eigen::Vector3d& point_m) const {
    double sum_m = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d &b = corners[(k + 1) % 3], &c = corners[(k + 2) % 3];
      const double share = (b - point_m).cross(c - point_m).dot(normal) / twice_area;
      sum_m += 0.5 * share * (corners[k] - point_m).dot(normals[k]);
    }
    return sum_m;
  }
};

constexpr double kSmooth = 0.75;  // cosine of 41°: what turns more is an edge

Face face_of(const Scan& scan, const std::array<std::uint32_t, 3>& corners,
             const std::vector<Eigen::Vector3d>& normals) {
  Face face;
  for (std::size_t k = 0; k < 3; ++k) face.corners[k] = scan.points_m[corners[k]];
  face.normal = (face.corners[1] - face.corners[0]).cross(face.corners[2] - face.corners[0]);
  face.twice_area = face.normal.norm();
  if (face.twice_area > 0.0) face.normal /= face.twice_area;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d& normal = normals[corners[k]];
    face.normals[k] = normal.dot(face.normal) > kSmooth ? normal : Eigen::Vector3d(Eigen::Vector3d::Zero());
  }
  return face;
}

/// A surfel of a face's piece.
void add_piece(const Face& face, const Triangle& piece, ScanSurfel surfel, double step_area,
               std::vector<ScanSurfel>& surfels) {
  const double area = 0.5 * (piece[1] - piece[0]).cross(piece[2] - piece[0]).norm();
  const Eigen::Vector3d middle_m = (piece[0] + piece[1] + piece[2]) / 3.0;
  surfel.position_m = (middle_m + face.stands_out_m(middle_m) * face.normal).cast<float>();
  surfel.weight = static_cast<float>(area / step_area);
  surfels.push_back(surfel);
}

/// The surfel of a face that need not be cut: all corners share alike in its middle. Most faces are such, so nothing
/// else is made of them.
ScanSurfel surfel_of_whole(const Scan& scan, const std::array<std::uint32_t, 3>& corners,
                           const std::vector<Eigen::Vector3d>& normals, double step_area) {
  const Eigen::Vector3d &a = scan.points_m[corners[0]], &b = scan.points_m[corners[1]], &c = scan.points_m[corners[2]];
  const Eigen::Vector3d to_b = b - a, to_c = c - a;
  const Eigen::Vector3d area = to_b.cross(to_c);
  const double twice_area = area.norm();
  const Eigen::Vector3d normal = area * (twice_area > 0.0 ? 1.0 / twice_area : 0.0);
  const Eigen::Vector3d to_middle = (to_b + to_c) / 3.0;
  const auto out_at = [&](std::uint32_t corner, const Eigen::Vector3d& from_middle) {
    const Eigen::Vector3d& own = normals[corner];
    return own.dot(normal) > kSmooth ? from_middle.dot(own) : 0.0;
  };
  const double out_m =
      (out_at(corners[0], -to_middle) + out_at(corners[1], to_b - to_middle) + out_at(corners[2], to_c - to_middle)) /
      6.0;
  ScanSurfel surfel;
  surfel.position_m = (a + to_middle + out_m * normal).cast<float>();
  // Paper, section 3: the cross product of face edges.
  surfel.inward_normal = -normal.cast<float>();
  surfel.weight = static_cast<float>(0.5 * twice_area / step_area);
  return surfel;
}

/// Cuts across the longest edge until no piece has one above the limit. `pieces` is for what is left to cut.
void add_pieces(const Face& face, double limit_m, double step_area, std::vector<Triangle>& pieces,
                std::vector<ScanSurfel>& surfels) {
  ScanSurfel surfel;
  surfel.inward_normal = -face.normal.cast<float>();
  double squared = 0.0;
  pieces.push_back(face.corners);
  while (!pieces.empty()) {
    const Triangle piece = pieces.back();
    pieces.pop_back();
    const std::size_t k = longest_edge(piece, squared);
    if (squared <= limit_m * limit_m) {
      add_piece(face, piece, surfel, step_area, surfels);
      continue;
    }
    const Eigen::Vector3d &from = piece[k], &to = piece[(k + 1) % 3], &apex = piece[(k + 2) % 3];
    const Eigen::Vector3d middle = 0.5 * (from + to);
    pieces.push_back({from, middle, apex});
    pieces.push_back({middle, to, apex});
  }
}

bool is_cut(const Scan& scan, const std::array<std::uint32_t, 3>& corners, double limit_m) {
  double squared = 0.0;
  longest_edge({scan.points_m[corners[0]], scan.points_m[corners[1]], scan.points_m[corners[2]]}, squared);
  return squared > limit_m * limit_m;
}

void add_mesh(const Scan& scan, std::size_t max_count, std::vector<ScanSurfel>& surfels) {
  double longest_m2 = 0.0;
  const std::vector<Eigen::Vector3d> normals = normals_at_points(scan, longest_m2);
  const double limit_m = piece_limit_m(scan, max_count, longest_m2);
  const double step_area = scan.grid_step_m * scan.grid_step_m;
  const bool all_whole = longest_m2 <= limit_m * limit_m;
  std::vector<Triangle> pieces;
  surfels.reserve(scan.faces.size());
  for (const std::array<std::uint32_t, 3>& corners : scan.faces) {
    if (all_whole || !is_cut(scan, corners, limit_m)) {
      surfels.push_back(surfel_of_whole(scan, corners, normals, step_area));
    } else {
      add_pieces(face_of(scan, corners, normals), limit_m, step_area, pieces, surfels);
    }
  }
}

void add_cloud(const Scan& scan, std::vector<ScanSurfel>& surfels) {
  surfels.reserve(scan.points_m.size());
  for (std::size_t i = 0; i < scan.points_m.size(); ++i) {
    ScanSurfel surfel;
    surfel.position_m = scan.points_m[i].cast<float>();
    surfel.inward_normal = -scan.normals[i];
    surfels.push_back(surfel);
  }
}

}  // namespace

std::vector<ScanSurfel> surfels_of(const Scan& scan, const ScanSurfelOptions& options) {
  const double steps = scan.kind == ScanKind::voxels ? 4.0 : 3.0;
  const double radius_m = options.normal_radius_m > 0.0 ? options.normal_radius_m : steps * scan.grid_step_m;
  std::vector<ScanSurfel> surfels;
  switch (scan.kind) {
    case ScanKind::mesh:
      add_mesh(scan, options.max_count, surfels);
      break;
    case ScanKind::cloud:
      add_cloud(scan, surfels);
      break;
    case ScanKind::voxels:
      add_voxel_surfels(scan.voxels, {options.normals, radius_m}, surfels);
      break;
    case ScanKind::height_map:
      add_height_surfels(scan.heights, {options.normals, radius_m}, surfels);
      break;
  }
  return surfels;
}

RadiusRange default_radius_range(const Scan& scan, std::span<const ScanSurfel> surfels) {
  Eigen::AlignedBox3f box;
  for (const ScanSurfel& surfel : surfels) box.extend(surfel.position_m);
  RadiusRange range;
  range.min_m = (scan.kind == ScanKind::cloud ? 1.5 : 2.0) * scan.grid_step_m;
  if (scan.kind == ScanKind::mesh) {
    // Faces stand in patterns, and every k-th would show some of the edges alone; of many some are enough, by chance.
    constexpr std::size_t kEnough = 20'000;
    const std::size_t leap = 2 * (scan.faces.size() / kEnough) + 1;
    std::mt19937 chance;
    std::vector<double> shortest;  // squared
    for (std::size_t i = 0; i < scan.faces.size(); i += leap > 1 ? 1 + chance() % leap : 1) {
      const auto& [a, b, c] = scan.faces[i];
      shortest.push_back(std::min({(scan.points_m[a] - scan.points_m[b]).squaredNorm(),
                                   (scan.points_m[b] - scan.points_m[c]).squaredNorm(),
                                   (scan.points_m[c] - scan.points_m[a]).squaredNorm()}));
    }
    const auto middle = shortest.begin() + static_cast<std::ptrdiff_t>(shortest.size() / 2);
    std::nth_element(shortest.begin(), middle, shortest.end());
    if (middle != shortest.end()) range.min_m = std::sqrt(*middle);
  }
  const double diagonal_m = box.isEmpty() ? 0.0 : static_cast<double>(box.diagonal().norm());
  range.max_m = std::max(0.25 * diagonal_m, 2.0 * range.min_m);
  return range;
}

}  // namespace tubetrack
