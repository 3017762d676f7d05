#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace tubetrack {

/// So many places side by side are asked for at once.
inline constexpr std::size_t kRowPlaces = 8;

/// Sums of weights around the places of some rows: those of `middle` [row + k − near], k up to kRowPlaces, added to the
/// row's sums in the order of `near`. The bytes do not depend on the vectors that the machine has.
void add_weights(const float* middle, std::span<const std::int32_t> near, std::span<const std::int32_t> rows,
                 std::span<float> sums);

}  // namespace tubetrack
