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

/// |slope|² per pixel; huge where there is no plane.
HWY_INLINE V Steepness2(V slope_u, V slope_v) {
  return hn::Add(hn::Mul(slope_u, slope_u), hn::Mul(slope_v, slope_v));
}

/// σ of a slope, per pixel, if all this is a plane: what depths jitter, and on a slope also what readings jitter
/// sideways. A plane is as steep everywhere, so it takes the steepness of the flattest of the windows: of what may be a
/// tube that leaves its flanks a vote. The second part is one frame's, however many were fused: it averages out as
/// well, but the levels that a sensor rounds to stay, and on a slope they bend (of a table 2 to 3 % of the cells would
/// vote after a second).
HWY_INLINE V FlatSlopeSigma(float lateral_px, int half, V axial_sigma, V least_steepness2) {
  const float side = static_cast<float>(2 * half + 1);
  const float moment_px2 = side * side * static_cast<float>(half * (half + 1)) / 3.0F;
  const V sideways = hn::Mul(least_steepness2, Set(lateral_px * lateral_px / moment_px2));
  return hn::Sqrt(hn::Add(hn::Mul(axial_sigma, axial_sigma), sideways));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#endif
