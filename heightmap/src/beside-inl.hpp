// How surfels look at the planes half a window to either side; compiled anew for each of Highway's targets.
#include "lanes-inl.hpp"
#include "window_planes.hpp"

#if defined(TUBETRACK_BESIDE_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef TUBETRACK_BESIDE_INL
#undef TUBETRACK_BESIDE_INL
#else
#define TUBETRACK_BESIDE_INL
#endif

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

constexpr float kRoot2 = 1.41421356F;

/// Where the planes of one image direction are known, and one over the pixels between them.
struct Between {
  M before, after, known;
  V per_px;
};

HWY_INLINE Between Spread(V slope_before, V slope_after, int half) {
  const V limit = Set(0.5F * kNoPlane);
  const M before = hn::Lt(slope_before, limit);
  const M after = hn::Lt(slope_after, limit);
  const float one_sided = 1.0F / static_cast<float>(half);
  return {before, after, hn::Or(before, after),
          hn::IfThenElse(hn::And(before, after), Set(0.5F * one_sided), Set(one_sided))};
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#endif
