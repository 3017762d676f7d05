#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "scan_grid.hpp"
#include "tubetrack/tracker/spline.hpp"

namespace tubetrack {

/// What is farther from the axis is none of a tube's.
inline constexpr double kFarthestRadii = 1.5;

/// A span of a centreline: place at s is c0 + s (c1 + s (c2 + s c3)). c0 is in two parts, a float and what that leaves
/// of it, so that a place on it is as exact far from zero as near it.
struct LineSpan {
  std::array<float, 3> c0, c0_rest, c1, c2, c3;
};

std::vector<LineSpan> line_spans_of(const Spline& spline);

/// Surfels and where on the line they may be: a span, and the place in it. Always whole vectors.
struct PlaceBatch {
  static constexpr std::size_t kSize = 64;
  alignas(64) std::array<std::int32_t, kSize> surfel{}, span{};
  alignas(64) std::array<float, kSize> s{};
  // What place_surfels gives, beside the span and the place where each surfel is.
  alignas(64) std::array<std::int32_t, kSize> belongs{};                       ///< 0 where it is none of the tube's
  alignas(64) std::array<float, kSize> lift_m{}, distance_m{}, x{}, y{}, z{};  ///< as SurfacePoint has it
};

/// Where on the line the first `count` surfels of a batch are, to a hundredth of a span: of a distance of R that is
/// less than a ten-thousandth. Behind them the batch's numbers are written over. The bytes do not depend on the vectors
/// that the machine has.
void place_surfels(std::span<const LineSpan> line, double radius_m, std::span<const CellSurfel> surfels,
                   std::size_t count, PlaceBatch& batch);

/// The nearest of some nodes to each of some surfels.
struct NearestBatch {
  static constexpr std::size_t kSize = 64;  ///< 4³ cells in a bucket
  alignas(64) std::array<std::int32_t, kSize> surfel{}, nearest{};
  alignas(64) std::array<float, kSize> squared_m2{};
};

/// Numbers among `nodes_m` (x, y, z each, from `origin_m`) and the squares of the ways there, for the first `count`.
void nearest_nodes(std::span<const std::array<float, 3>> nodes_m, const std::array<float, 3>& origin_m,
                   std::span<const CellSurfel> surfels, std::size_t count, NearestBatch& batch);

}  // namespace tubetrack
