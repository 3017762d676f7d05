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
  for (const std::int32_t row : rows) {
    for (std::size_t k = 0; k < kRowPlaces; k += hn::Lanes(d)) {
      const float* const first = middle + row + k;
      auto sum = hn::LoadU(d, sums + k);
      for (const std::int32_t place : near) sum = hn::Add(sum, hn::LoadU(d, first - place));
      hn::StoreU(sum, d, sums + k);
    }
    sums += kRowPlaces;
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
