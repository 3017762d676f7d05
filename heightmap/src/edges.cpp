#include "edges.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "edges.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;

/// EdgeRule::is_edge for neighbours.
HWY_INLINE hn::Mask<D> IsEdge(const EdgeRule& rule, V a, V b) {
  const D d;
  const V sum = hn::Add(a, b);
  const V product = hn::Mul(a, b);
  const V apart = hn::Abs(hn::Sub(b, a));
  // Most cells end here: less than 99 % of what the slope alone allows, whatever the noise.
  const auto steep = hn::Gt(hn::Mul(apart, sum), hn::Mul(product, hn::Set(d, 1.98F * rule.slope_per_px)));
  if (hn::AllFalse(d, steep)) return steep;
  const V zero = hn::Zero(d);
  const auto both = hn::And(hn::Gt(a, zero), hn::Gt(b, zero));
  const V mean = hn::Mul(hn::Set(d, 0.5F), sum);
  const V mean2 = hn::Mul(mean, mean);
  const V jump = hn::Mul(apart, mean2);
  const V slope = hn::Mul(hn::Set(d, rule.slope_per_px), mean);
  const V off = hn::Sub(hn::Set(d, 1.0F), hn::Mul(hn::Set(d, rule.noise.reference_m), mean));
  const V gauss = hn::Add(hn::Mul(hn::Set(d, rule.noise.constant_m), mean2),
                          hn::Mul(hn::Set(d, rule.noise.quadratic_per_m), hn::Mul(off, off)));
  const V sigma = hn::Sqrt(hn::Add(hn::Mul(gauss, gauss), hn::Set(d, rule.noise.rounding_variance_per_m2)));
  const V allowed = hn::Mul(product, hn::Add(hn::Mul(hn::Set(d, 4.0F), sigma), slope));
  return hn::And(both, hn::Gt(jump, allowed));
}

HWY_INLINE std::uint64_t Bits(hn::Mask<D> mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(D(), mask, bytes);
  return bytes[0] | static_cast<std::uint64_t>(bytes[1]) << 8;
}

/// Edges to the right neighbour and to the row below, and where there are heights; 64 columns a word.
void EdgesOfRow(const EdgeRule& rule, const std::int32_t* row, const std::int32_t* below, int word_begin, int word_end,
                std::uint64_t* valid, std::uint64_t* right, std::uint64_t* down) {
  const D d;
  const hn::Rebind<std::int32_t, D> di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const V unit = hn::Set(d, kHeightUnit_per_m);
  for (int word = word_begin; word < word_end; ++word) {
    std::uint64_t valid_bits = 0;
    std::uint64_t right_bits = 0;
    std::uint64_t down_bits = 0;
    for (int i = 0; i < 64; i += lanes) {
      const int at = 64 * word + i;
      const V here = hn::Mul(hn::ConvertTo(d, hn::LoadU(di, row + at)), unit);
      const V beside = hn::Mul(hn::ConvertTo(d, hn::LoadU(di, row + at + 1)), unit);
      const V under = hn::Mul(hn::ConvertTo(d, hn::LoadU(di, below + at)), unit);
      valid_bits |= Bits(hn::Gt(here, hn::Zero(d))) << i;
      right_bits |= Bits(IsEdge(rule, here, beside)) << i;
      down_bits |= Bits(IsEdge(rule, here, under)) << i;
    }
    valid[word] = valid_bits;
    right[word] = right_bits;
    down[word] = down_bits;
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(EdgesOfRow);

namespace {

/// Edges across gaps of a cell beside one: `du`, `dv` is the way to the gap.
void edge_across_gap(const Heights& heights, const EdgeRule& rule, const BitImage& valid, int u, int v, int du, int dv,
                     BitImage& edges) {
  for (int gap = 2; gap <= kGapLimit_px; ++gap) {
    const int other_u = u + du * gap;
    const int other_v = v + dv * gap;
    if (other_u < 0 || other_u >= valid.grid.width || other_v < 0 || other_v >= valid.grid.height) return;
    if (!valid.get(other_u, other_v)) continue;
    if (rule.is_edge(heights.height[heights.grid.at(u, v)], heights.height[heights.grid.at(other_u, other_v)], gap)) {
      edges.set(u, v);
    }
    return;
  }
}

/// The cells of one word that have a neighbour without height.
void edges_across_gaps(const Heights& heights, const EdgeRule& rule, const BitImage& valid, int v, int word,
                       BitImage& edges) {
  const std::uint64_t* row = valid.row(v);
  const std::uint64_t here = row[word];
  // Beyond the image there is nothing to find, nor in the margins a cell to find it for.
  const std::uint64_t left = here << 1 | row[word - 1] >> 63;
  const std::uint64_t right = here >> 1 | row[word + 1] << 63;
  const std::uint64_t above = v > 0 ? valid.row(v - 1)[word] : here;
  const std::uint64_t below = v + 1 < valid.grid.height ? valid.row(v + 1)[word] : here;
  if ((here & ~(left & right & above & below)) == 0) return;
  const auto each = [&](std::uint64_t bits, int du, int dv) {
    for (; bits != 0; bits &= bits - 1) {
      const int u = 64 * word + std::countr_zero(bits) - kMargin_px;
      edge_across_gap(heights, rule, valid, u, v, du, dv, edges);
    }
  };
  each(here & ~left, -1, 0);
  each(here & ~right, 1, 0);
  each(here & ~above, 0, -1);
  each(here & ~below, 0, 1);
}

}  // namespace

EdgeRule::EdgeRule(const NoiseModel& model, double fx_px)
    : noise(model), slope_per_px(static_cast<float>(4.7 / fx_px)) {}  // a surface seen at 78° drops 4.7 pixel widths

bool EdgeRule::is_edge(std::int32_t a, std::int32_t b, int gap_px) const {
  const float wa = static_cast<float>(a) * kHeightUnit_per_m;
  const float wb = static_cast<float>(b) * kHeightUnit_per_m;
  const float mean = 0.5F * (wa + wb);
  const float off = 1.0F - noise.reference_m * mean;
  const float gauss = noise.constant_m * (mean * mean) + noise.quadratic_per_m * (off * off);
  const float sigma = std::sqrt(gauss * gauss + noise.rounding_variance_per_m2);
  // |1/wa − 1/wb| against 4 σ of depth and the slope, times wa wb and mean².
  const float slope = slope_per_px * static_cast<float>(std::min(gap_px, 3)) * mean;
  return std::abs(wb - wa) * (mean * mean) > wa * wb * (4.0F * sigma + slope);
}

void compare_neighbours(const Heights& heights, const EdgeRule& rule, const WordArea& area, Edges& out) {
  const Grid& grid = heights.grid;
  for (int v = area.v_begin; v < area.v_end; ++v) {
    const std::int32_t* row = heights.height.data() + grid.at(-kMargin_px, v);
    const std::int32_t* below = v + 1 < grid.height ? row + grid.stride() : row;
    HWY_DYNAMIC_DISPATCH(EdgesOfRow)
    (rule, row, below, area.word_begin, area.word_end, out.valid.row(v), out.right.row(v), out.down.row(v));
  }
}

void find_edges(const Heights& heights, const EdgeRule& rule, const WordArea& area, Edges& out) {
  for (int v = area.v_begin; v < area.v_end; ++v) {
    const std::uint64_t* right = out.right.row(v);
    const std::uint64_t* down = out.down.row(v);
    for (int i = area.word_begin; i < area.word_end; ++i) {
      const std::uint64_t above = v > 0 ? out.down.row(v - 1)[i] : 0;
      out.edges.row(v)[i] = right[i] | right[i] << 1 | right[i - 1] >> 63 | down[i] | above;
      edges_across_gaps(heights, rule, out.valid, v, i, out.edges);
    }
  }
}

}  // namespace tubetrack
#endif
