#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "ball_sums.hpp"
#include "grid_surfels.hpp"
#include "voronoi_normals.hpp"

namespace tubetrack {

namespace {

/// The six faces of a voxel: the way to the neighbour, and the area vector that way.
struct FaceShape {
  Eigen::Vector3i step;
  Eigen::Vector3d outward_area_m2;
};

std::array<FaceShape, 6> face_shapes(const Eigen::Matrix3d& axes_m) {
  std::array<FaceShape, 6> shapes;
  std::size_t next = 0;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3d area_m2 = axes_m.col((axis + 1) % 3).cross(axes_m.col((axis + 2) % 3));
    if (area_m2.dot(axes_m.col(axis)) < 0.0) area_m2 = -area_m2;  // the axes may be left-handed
    for (const int sign : {-1, 1}) shapes[next++] = {sign * Eigen::Vector3i::Unit(axis), sign * area_m2};
  }
  return shapes;
}

Eigen::Vector3d center_of(const VoxelGrid& grid, const BoundaryFace& face) {
  return grid.origin_m + grid.axes_m * (0.5 * face.twice.cast<double>());
}

std::uint64_t eight_at(const std::uint8_t* first) {
  std::uint64_t eight = 0;
  std::memcpy(&eight, first, 8);
  return eight;
}

/// The first voxel of a row, from the i-th on, that is in the body; `count` where none is. Most of a volume is empty.
int next_inside(const std::uint8_t* row, int i, int count) {
  while (i + 32 <= count &&
         (eight_at(row + i) | eight_at(row + i + 8) | eight_at(row + i + 16) | eight_at(row + i + 24)) == 0)
    i += 32;
  while (i + 8 <= count && eight_at(row + i) == 0) i += 8;
  while (i < count && row[i] == 0) ++i;
  return i;
}

/// The weights of a face's neighbours, by how many half voxels they are away along each axis; alike both ways.
class BallWeights {
 public:
  /// Offsets up to `block` half voxels beyond the ball may be asked for.
  BallWeights(const Eigen::Matrix3d& axes_m, double radius_m, int block) {
    const Eigen::Matrix3d inverse = axes_m.inverse();
    for (int axis = 0; axis < 3; ++axis) {
      reach_[axis] = static_cast<int>(std::floor(2.0 * radius_m * inverse.row(axis).norm() + 1e-9));
      half_[axis] = reach_[axis] + block;
    }
    const double sigma_m = 0.5 * radius_m;
    for (int z = -half_.z(); z <= half_.z(); ++z) {
      for (int y = -half_.y(); y <= half_.y(); ++y) {
        for (int x = -half_.x(); x <= half_.x(); ++x) {
          const double squared = (axes_m * (0.5 * Eigen::Vector3d(x, y, z))).squaredNorm();
          const bool within = squared <= radius_m * radius_m * (1.0 + 1e-9);
          weights_.push_back(within ? static_cast<float>(std::exp(-0.5 * squared / (sigma_m * sigma_m))) : 0.0F);
        }
      }
    }
  }

  const Eigen::Vector3i& reach() const { return reach_; }
  /// Where the weight of an offset stands; differences of places in the grid add up.
  int place(const Eigen::Vector3i& at) const {
    return (at.z() * (2 * half_.y() + 1) + at.y()) * (2 * half_.x() + 1) + at.x();
  }
  const float* middle() const { return weights_.data() + place(half_); }

 private:
  Eigen::Vector3i reach_, half_;
  std::vector<float> weights_;
};

constexpr int kBlock = 8;  // half voxels: an edge of 4 voxels
static_assert(kBlock == kRowPlaces);

/// Faces by the block of 4³ voxels that they lie in.
struct FaceBlocks {
  Eigen::Vector3i size;
  std::vector<std::uint32_t> first, numbers;
  std::vector<BoundaryFace> faces;  // those of a block stand together

  FaceBlocks(const VoxelGrid& grid, const std::vector<BoundaryFace>& all) {
    size = (2 * grid.size.array() + kBlock) / kBlock;
    first.assign(
        static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(size.z()) +
            1,
        0);
    for (const BoundaryFace& face : all) ++first[at(face.twice / kBlock) + 1];
    for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    numbers.resize(all.size());
    faces.resize(all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::uint32_t place = next[at(all[i].twice / kBlock)]++;
      numbers[place] = static_cast<std::uint32_t>(i);
      faces[place] = all[i];
    }
  }
  std::size_t at(const Eigen::Vector3i& block) const {
    return (static_cast<std::size_t>(block.z()) * static_cast<std::size_t>(size.y()) +
            static_cast<std::size_t>(block.y())) *
               static_cast<std::size_t>(size.x()) +
           static_cast<std::size_t>(block.x());
  }
};

/// Of the faces around a block, by shape: their places as BallWeights counts them, from the block on.
using NearPlaces = std::array<std::vector<std::int32_t>, 6>;

void gather_near(const FaceBlocks& blocks, const BallWeights& weights, const Eigen::Vector3i& block, NearPlaces& near) {
  for (std::vector<std::int32_t>& places : near) places.clear();
  const Eigen::Array3i low = kBlock * block.array() - weights.reach().array();
  const Eigen::Array3i high = kBlock * block.array() + kBlock - 1 + weights.reach().array();
  const Eigen::Vector3i from = (low.max(0) / kBlock).matrix();
  const Eigen::Vector3i to = (high / kBlock).min(blocks.size.array() - 1).matrix();
  for (int z = from.z(); z <= to.z(); ++z) {
    for (int y = from.y(); y <= to.y(); ++y) {
      for (std::uint32_t i = blocks.first[blocks.at({from.x(), y, z})]; i < blocks.first[blocks.at({to.x(), y, z}) + 1];
           ++i) {
        const BoundaryFace& face = blocks.faces[i];
        if ((face.twice.array() < low).any() || (face.twice.array() > high).any()) continue;
        near[static_cast<std::size_t>(face.shape)].push_back(weights.place(face.twice - kBlock * block));
      }
    }
  }
}

}  // namespace

std::vector<BoundaryFace> boundary_faces(const VoxelGrid& grid) {
  const auto shapes = face_shapes(grid.axes_m);
  const std::ptrdiff_t row = grid.size.x(), slice = row * grid.size.y();
  const std::array<std::ptrdiff_t, 6> to_next{-1, 1, -row, row, -slice, slice};
  const auto is_between = [](int at, int count) { return at > 0 && at + 1 < count; };
  std::vector<BoundaryFace> faces;
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      const std::uint8_t* begin = grid.inside.data() + grid.at(0, j, k);
      for (int i = 0; (i = next_inside(begin, i, grid.size.x())) < grid.size.x(); ++i) {
        const std::uint8_t* voxel = begin + i;
        const bool all_around =
            is_between(i, grid.size.x()) && is_between(j, grid.size.y()) && is_between(k, grid.size.z());
        // Most voxels are deep inside.
        if (all_around && (voxel[-1] & voxel[1] & voxel[-row] & voxel[row] & voxel[-slice] & voxel[slice]) != 0)
          continue;
        for (std::size_t n = 0; n < shapes.size(); ++n) {
          const Eigen::Vector3i next = Eigen::Vector3i(i, j, k) + shapes[n].step;
          if (!all_around && !grid.contains(next.x(), next.y(), next.z())) continue;
          if (voxel[to_next[n]] == 0)
            faces.push_back({2 * Eigen::Vector3i(i, j, k) + shapes[n].step, static_cast<int>(n)});
        }
      }
    }
  }
  return faces;
}

std::vector<Eigen::Vector3f> smoothed_normals(const VoxelGrid& grid, const std::vector<BoundaryFace>& faces,
                                              double radius_m) {
  const auto shapes = face_shapes(grid.axes_m);
  const BallWeights weights(grid.axes_m, radius_m, kBlock - 1);
  const FaceBlocks blocks(grid, faces);
  std::vector<Eigen::Vector3f> normals(faces.size());
  NearPlaces near;
  std::vector<std::int32_t> rows;  // of the block that hold a face
  constexpr std::size_t kNoRow = ~std::size_t{0};
  std::array<std::size_t, kBlock * kBlock> row_of{};
  std::array<std::vector<float>, 6> sums;
  std::size_t begin = 0;
  while (begin < faces.size()) {
    const Eigen::Vector3i block = blocks.faces[begin].twice / kBlock;
    const std::size_t end = blocks.first[blocks.at(block) + 1];
    gather_near(blocks, weights, block, near);
    const auto row_in_block = [&](std::size_t i) {
      const Eigen::Vector3i at = blocks.faces[i].twice - kBlock * block;
      return static_cast<std::size_t>(at.z()) * kBlock + static_cast<std::size_t>(at.y());
    };
    rows.clear();
    row_of.fill(kNoRow);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t row = row_in_block(i);
      if (row_of[row] != kNoRow) continue;
      row_of[row] = rows.size();
      rows.push_back(weights.place({0, static_cast<int>(row) % kBlock, static_cast<int>(row) / kBlock}));
    }
    for (std::size_t n = 0; n < shapes.size(); ++n) {
      sums[n].assign(rows.size() * kRowPlaces, 0.0F);
      add_weights(weights.middle(), near[n], rows, sums[n]);
    }
    for (std::size_t i = begin; i < end; ++i) {
      const BoundaryFace& face = blocks.faces[i];
      const Eigen::Vector3d& own = shapes[static_cast<std::size_t>(face.shape)].outward_area_m2;
      const std::size_t at = row_of[row_in_block(i)] * kRowPlaces + static_cast<std::size_t>(face.twice.x() % kBlock);
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t n = 0; n < shapes.size(); ++n)
        sum += static_cast<double>(sums[n][at]) * shapes[n].outward_area_m2;
      // Opposite sides of a plate thinner than the ball cancel out; then the face's own normal has to do.
      const bool cancelled = !(sum.norm() > 1e-6 * own.norm());
      normals[blocks.numbers[i]] = (cancelled ? own : sum).normalized().cast<float>();
    }
    begin = end;
  }
  return normals;
}

namespace {

std::vector<Eigen::Vector3f> voronoi_normals_of(const VoxelGrid& grid, const std::vector<BoundaryFace>& faces,
                                                double step_m, double radius_m) {
  const auto shapes = face_shapes(grid.axes_m);
  std::vector<Eigen::Vector3d> centers_m, outward;
  for (const BoundaryFace& face : faces) {
    centers_m.push_back(center_of(grid, face));
    outward.push_back(shapes[static_cast<std::size_t>(face.shape)].outward_area_m2);
  }
  return voronoi_normals(centers_m, outward, {step_m, kVoronoiOffset * radius_m, kVoronoiRadius * radius_m});
}

}  // namespace

void add_voxel_surfels(const VoxelGrid& grid, const NormalWindow& window, std::vector<ScanSurfel>& surfels) {
  const std::vector<BoundaryFace> faces = boundary_faces(grid);
  if (faces.empty()) return;
  const double step_m = std::cbrt(std::abs(grid.axes_m.determinant()));
  const std::vector<Eigen::Vector3f> normals = window.method == GridNormals::voronoi
                                                   ? voronoi_normals_of(grid, faces, step_m, window.radius_m)
                                                   : smoothed_normals(grid, faces, window.radius_m);
  const auto shapes = face_shapes(grid.axes_m);
  const double step_area = step_m * step_m;
  surfels.reserve(faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    ScanSurfel surfel;
    surfel.position_m = center_of(grid, faces[i]).cast<float>();
    surfel.inward_normal = -normals[i];
    const double seen =
        shapes[static_cast<std::size_t>(faces[i].shape)].outward_area_m2.dot(normals[i].cast<double>()) / step_area;
    surfel.weight = static_cast<float>(std::max(0.0, seen));
    surfels.push_back(surfel);
  }
}

}  // namespace tubetrack
