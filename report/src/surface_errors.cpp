#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "tubetrack/report/surface_mesh.hpp"
#include "tubetrack/tracker/packed_cell.hpp"

namespace tubetrack {

namespace {

constexpr double kFarthestRadii = 1.5;

/// A piece of a centreline.
struct LinePiece {
  Eigen::Vector3d from_m, along_m;
  double radius_m;
};

std::vector<LinePiece> pieces_of(std::span<const Tube> tubes) {
  std::vector<LinePiece> pieces;
  for (const Tube& tube : tubes) {
    constexpr int kPieces = 4;
    const std::vector<Eigen::Vector3d> line = smooth_centerline(tube, kPieces);
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
      const std::size_t node = i / kPieces;
      const double radius_m = node < tube.node_radius_m.size() ? tube.node_radius_m[node] : tube.radius_m;
      pieces.push_back({line[i], line[i + 1] - line[i], radius_m});
    }
  }
  return pieces;
}

/// Pieces by the cells of a coarse grid that they reach, so that a point is compared with few.
class PieceGrid {
 public:
  explicit PieceGrid(std::vector<LinePiece> pieces) : pieces_(std::move(pieces)) {
    for (const LinePiece& piece : pieces_) cell_m_ = std::max(cell_m_, kFarthestRadii * piece.radius_m);
    if (!(cell_m_ > 0.0)) return;
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
      Eigen::AlignedBox3d box(pieces_[i].from_m);
      box.extend(pieces_[i].from_m + pieces_[i].along_m);
      const double reach_m = kFarthestRadii * pieces_[i].radius_m;
      const Eigen::Vector3d low = (box.min().array() - reach_m) / cell_m_,
                            high = (box.max().array() + reach_m) / cell_m_;
      for (double z = std::floor(low.z()); z <= high.z(); ++z) {
        for (double y = std::floor(low.y()); y <= high.y(); ++y) {
          for (double x = std::floor(low.x()); x <= high.x(); ++x) near_[packed_cell({x, y, z}, 1.0)].push_back(i);
        }
      }
    }
  }

  /// From the surface of all tubes together, NaN where none is near. Signed until the last: inside, a piece farther
  /// along may have its surface nearer, but that is no surface of the tube.
  double distance(const Eigen::Vector3d& point_m) const {
    double least = std::numeric_limits<double>::quiet_NaN();
    if (!(cell_m_ > 0.0)) return least;
    const auto cell = near_.find(packed_cell(point_m, cell_m_));
    if (cell == near_.end()) return least;
    for (const std::size_t i : cell->second) {
      const LinePiece& piece = pieces_[i];
      const double squared = piece.along_m.squaredNorm();
      const double share = squared > 0.0 ? (point_m - piece.from_m).dot(piece.along_m) / squared : 0.0;
      const double axis_m = (piece.from_m + std::clamp(share, 0.0, 1.0) * piece.along_m - point_m).norm();
      if (axis_m > kFarthestRadii * piece.radius_m) continue;
      const double outside_m = axis_m - piece.radius_m;
      if (!(outside_m >= least)) least = outside_m;
    }
    return std::abs(least);
  }

 private:
  std::vector<LinePiece> pieces_;
  double cell_m_ = 0.0;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> near_;
};

/// Blue, cyan, green, yellow, red over 0 … 1.
std::array<std::uint8_t, 3> heat(double share) {
  const double at = 4.0 * std::clamp(share, 0.0, 1.0);
  const auto byte = [](double value) {
    return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(value, 0.0, 1.0)));
  };
  return {byte(at - 2.0), byte(at < 2.0 ? at : 4.0 - at), byte(2.0 - at)};
}

}  // namespace

SurfaceErrors color_by_distance(SurfaceMesh& mesh, std::span<const Tube> tubes) {
  const PieceGrid grid(pieces_of(tubes));
  std::vector<double> known;
  mesh.distance_m.clear();
  for (const Eigen::Vector3d& point_m : mesh.points_m) {
    const double distance_m = grid.distance(point_m);
    mesh.distance_m.push_back(static_cast<float>(distance_m));
    if (std::isfinite(distance_m)) known.push_back(distance_m);
  }
  std::sort(known.begin(), known.end());
  SurfaceErrors errors;
  errors.on_tubes = known.size();
  errors.off_tubes = mesh.points_m.size() - known.size();
  const auto quantile = [&known](double share) {
    return known[static_cast<std::size_t>(std::lround(share * static_cast<double>(known.size() - 1)))];
  };
  if (!known.empty()) {
    errors.min_m = known.front();
    errors.median_m = quantile(0.5);
    errors.percentile_95_m = quantile(0.95);
    errors.max_m = known.back();
  }
  mesh.colors.clear();
  const double full_m = std::max(errors.percentile_95_m, 1e-12);
  for (const float distance_m : mesh.distance_m) {
    constexpr std::array<std::uint8_t, 3> kGrey{150, 150, 150};
    mesh.colors.push_back(std::isfinite(distance_m) ? heat(static_cast<double>(distance_m) / full_m) : kGrey);
  }
  return errors;
}

}  // namespace tubetrack
