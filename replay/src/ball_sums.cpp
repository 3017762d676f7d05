#include "ball_sums.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ball_sums.cpp"
#include <hwy/foreach_target.h>
// Highway's own header comes after it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

void AddWeights(const float* middle, std::span<const std::int32_t> near, std::span<const std::int32_t> rows,
                float* sums) {
  const hn::CappedTag<float, kRowPlaces> d;
  // Four rows at once: an addition takes as long as four of them.
  std::size_t row = 0;
  for (; row + 4 <= rows.size(); row += 4, sums += 4 * kRowPlaces) {
    for (std::size_t k = 0; k < kRowPlaces; k += hn::Lanes(d)) {
      const float* const first = middle + k;
      const float *const first0 = first + rows[row], *const first1 = first + rows[row + 1];
      const float *const first2 = first + rows[row + 2], *const first3 = first + rows[row + 3];
      auto sum0 = hn::LoadU(d, sums + k), sum1 = hn::LoadU(d, sums + kRowPlaces + k);
      auto sum2 = hn::LoadU(d, sums + 2 * kRowPlaces + k), sum3 = hn::LoadU(d, sums + 3 * kRowPlaces + k);
      for (const std::int32_t place : near) {
        sum0 = hn::Add(sum0, hn::LoadU(d, first0 - place));
        sum1 = hn::Add(sum1, hn::LoadU(d, first1 - place));
        sum2 = hn::Add(sum2, hn::LoadU(d, first2 - place));
        sum3 = hn::Add(sum3, hn::LoadU(d, first3 - place));
      }
      hn::StoreU(sum0, d, sums + k);
      hn::StoreU(sum1, d, sums + kRowPlaces + k);
      hn::StoreU(sum2, d, sums + 2 * kRowPlaces + k);
      hn::StoreU(sum3, d, sums + 3 * kRowPlaces + k);
    }
  }
  for (; row < rows.size(); ++row, sums += kRowPlaces) {
    for (std::size_t k = 0; k < kRowPlaces; k += hn::Lanes(d)) {
      const float* const first = middle + rows[row] + k;
      auto sum = hn::LoadU(d, sums + k);
      for (const std::int32_t place : near) sum = hn::Add(sum, hn::LoadU(d, first - place));
      hn::StoreU(sum, d, sums + k);
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tubetrack {

HWY_EXPORT(AddWeights);

void add_weights(const float* middle, std::span<const std::int32_t> near, std::span<const std::int32_t> rows,
                 std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(AddWeights)(middle, near, rows, sums.data());
}

}  // namespace tubetrack
#endif
