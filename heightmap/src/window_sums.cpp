#include "window_sums.hpp"

#include <hwy/cache_control.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "window_sums.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<std::uint32_t, 16>;
using V = hn::Vec<D>;

#if HWY_TARGET == HWY_SCALAR

struct Running {
  HWY_INLINE V operator()(V v, V& carry) const {
    carry = hn::Add(v, carry);
    return carry;
  }
};

#else

/// Running sums over the lanes of a vector, the carry added and moved on: within blocks of four lanes first, then what
/// the blocks before them come to.
struct Running {
  using Places = decltype(hn::IndicesFromVec(D(), hn::Zero(D())));
  V beyond4, beyond8;
  Places back4, back8, last;

  HWY_INLINE Running()
      : beyond4(hn::VecFromMask(D(), hn::Not(hn::FirstN(D(), 4)))),
        beyond8(hn::VecFromMask(D(), hn::Not(hn::FirstN(D(), 8)))),
        back4(Back(4)),
        back8(Back(8)),
        last(hn::IndicesFromVec(D(), hn::Set(D(), static_cast<std::uint32_t>(hn::Lanes(D()) - 1)))) {}

  /// The last lane of the block of four that is `by` lanes back.
  static HWY_INLINE Places Back(std::uint32_t by) {
    const D d;
    const auto lanes = static_cast<std::uint32_t>(hn::Lanes(d));
    const V last_of_block = hn::Or(hn::Sub(hn::Iota(d, lanes), hn::Set(d, by)), hn::Set(d, 3));
    return hn::IndicesFromVec(d, hn::And(last_of_block, hn::Set(d, lanes - 1)));
  }

  HWY_INLINE V operator()(V v, V& carry) const {
    v = hn::Add(v, hn::ShiftLeftLanes<1>(v));
    v = hn::Add(v, hn::ShiftLeftLanes<2>(v));
    if (hn::Lanes(D()) > 4) v = hn::Add(v, hn::And(hn::TableLookupLanes(v, back4), beyond4));
    if (hn::Lanes(D()) > 8) v = hn::Add(v, hn::And(hn::TableLookupLanes(v, back8), beyond8));
    const V sums = hn::Add(v, carry);
    carry = hn::Add(carry, hn::TableLookupLanes(v, last));
    return sums;
  }
};

#endif

/// One row of the table. `above`, `below`: the row's start and its next in each channel, `stride` apart. The next row
/// of heights, `next` cells on, is fetched meanwhile: rows of a narrow strip are too short for the processor to see
/// what comes.
void AddRow(const std::int32_t* height, const std::int32_t* variance, std::ptrdiff_t next, int u_begin, int v,
            int columns, const std::uint8_t* near_holes, const std::uint32_t* above, std::uint32_t* below,
            std::size_t stride) {
  const D d;
  const Running prefix;
  const V row = hn::Set(d, static_cast<std::uint32_t>(v));
  const V one = hn::Set(d, 1U);
  const V lane = hn::Iota(d, 0U);  // slow where it is needed anew
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto add = [&](int channel, int i, V sums) HWY_ATTR {
    const std::size_t at = static_cast<std::size_t>(channel) * stride + static_cast<std::size_t>(i) + 1;
    hn::StoreU(hn::Add(hn::LoadU(d, above + at), sums), d, below + at);
  };
  for (std::size_t c = 0; c < kSumChannels; ++c) below[c * stride] = above[c * stride];
  V carry_h = hn::Zero(d);
  V carry_uh = hn::Zero(d);
  V carry_variance = hn::Zero(d);
  for (int i = 0; i < columns; i += lanes) {
    hwy::Prefetch(height + next + i);
    hwy::Prefetch(variance + next + i);
    const V h = hn::LoadU(d, reinterpret_cast<const std::uint32_t*>(height + i));
    const V sum_h = prefix(h, carry_h);
    add(kH, i, sum_h);
    add(kVH, i, hn::Mul(row, sum_h));
    add(kUH, i, prefix(hn::Mul(hn::Add(lane, hn::Set(d, static_cast<std::uint32_t>(u_begin + i))), h), carry_uh));
    add(kVariance, i, prefix(hn::LoadU(d, reinterpret_cast<const std::uint32_t*>(variance + i)), carry_variance));
  }
  V carry_n = hn::Zero(d);
  V carry_u = hn::Zero(d);
  V carry_uu = hn::Zero(d);
  for (int i = 0; i < columns; i += lanes) {
    // Left of the image there are no flags, but a window at its border takes its sums from there.
    if (!near_holes[i / kSumBlock_px] && u_begin + i >= 0) continue;
    const V u = hn::Add(lane, hn::Set(d, static_cast<std::uint32_t>(u_begin + i)));
    const V n = hn::Min(hn::LoadU(d, reinterpret_cast<const std::uint32_t*>(height + i)), one);
    const V nu = hn::Mul(n, u);
    const V sum_n = prefix(n, carry_n);
    const V sum_u = prefix(nu, carry_u);
    const V sum_v = hn::Mul(row, sum_n);
    add(kCount, i, sum_n);
    add(kU, i, sum_u);
    add(kV, i, sum_v);
    add(kUU, i, prefix(hn::Mul(nu, u), carry_uu));
    add(kUV, i, hn::Mul(row, sum_u));
    add(kVV, i, hn::Mul(row, sum_v));
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(AddRow);

void WindowSums::start(int u_begin, int columns) {
  u_begin_ = u_begin;
  stride_ = static_cast<std::size_t>(columns) + 16;
  if (ring_.size() < kRows * kSumChannels * stride_) ring_.resize(kRows * kSumChannels * stride_);
}

void WindowSums::add_row(const Heights& heights, int v, int u_begin, int u_end, const std::uint8_t* near_holes) {
  const std::size_t from = heights.grid.at(u_begin, v);
  const auto to = static_cast<std::size_t>(index(u_begin));
  const std::ptrdiff_t next = v + 1 < heights.grid.height ? heights.grid.stride() : 0;
  HWY_DYNAMIC_DISPATCH(AddRow)
  (heights.height.data() + from, heights.variance.data() + from, next, u_begin, v, u_end - u_begin, near_holes,
   ring_.data() + offset(v) + to, ring_.data() + offset(v + 1) + to, stride_);
}

}  // namespace tubetrack
#endif
