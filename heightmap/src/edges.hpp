#pragma once

#include "axial_noise.hpp"
#include "bit_image.hpp"
#include "grid.hpp"

namespace tubetrack {

/// No window that is used spans a gap this wide with cells on both sides.
inline constexpr int kGapLimit_px = 20;

/// A depth edge is a jump between neighbours in a row or column, also across a gap without returns, that neither the
/// noise nor a grazing surface explains. `slope_per_px` is what one pixel may do to ln(depth).
struct EdgeRule {
  AxialNoise noise;
  float slope_per_px = 0.0F;

  EdgeRule(const NoiseModel& model, double fx_px);
  bool operator==(const EdgeRule&) const = default;
  /// Heights in units, `gap_px` apart.
  bool is_edge(std::int32_t a, std::int32_t b, int gap_px) const;
};

struct Edges {
  BitImage valid;  ///< cells with a height
  BitImage edges;  ///< cells beside a depth edge
  BitImage right;  ///< edge to the right neighbour
  BitImage down;   ///< edge to the neighbour below

  void resize(const Grid& grid) {
    for (BitImage* image : {&valid, &edges, &right, &down}) image->resize(grid);
  }
};

/// Compares neighbours: `valid`, `right` and `down` of an area.
void compare_neighbours(const Heights& heights, const EdgeRule& rule, const WordArea& area, Edges& out);

/// `edges` of an area, from what `compare_neighbours` left in it and up to kGapLimit_px around.
void find_edges(const Heights& heights, const EdgeRule& rule, const WordArea& area, Edges& out);

}  // namespace tubetrack
