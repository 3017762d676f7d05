// What kernels of rows share, compiled anew for each of Highway's targets.
#include <hwy/highway.h>

#include <cstdint>

#if defined(TUBETRACK_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef TUBETRACK_LANES_INL
#undef TUBETRACK_LANES_INL
#else
#define TUBETRACK_LANES_INL
#endif

HWY_BEFORE_NAMESPACE();
namespace tubetrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using DI = hn::Rebind<std::int32_t, D>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;
using VI = hn::Vec<DI>;

HWY_INLINE V Set(float value) {
  return hn::Set(D(), value);
}

/// A bit for each lane.
HWY_INLINE std::uint64_t Bits(M mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(D(), mask, bytes);
  return bytes[0] | static_cast<std::uint64_t>(bytes[1]) << 8;
}

HWY_INLINE M MaskOf(std::uint64_t bits) {
  return hn::LoadMaskBits(D(), reinterpret_cast<const std::uint8_t*>(&bits));  // little-endian, as Highway's targets
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace tubetrack
HWY_AFTER_NAMESPACE();

#endif
