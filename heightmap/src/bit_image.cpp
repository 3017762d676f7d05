#include "bit_image.hpp"

#include <algorithm>

namespace tubetrack {

void spread_in_rows(const BitImage& from, int by, int v_begin, int v_end, BitImage& to) {
  const int words = from.grid.words();
  for (int v = v_begin; v < v_end; ++v) {
    const std::uint64_t* in = from.row(v);
    std::uint64_t* out = to.row(v);
    for (int i = 0; i < words; ++i) {
      const std::uint64_t here = in[i];
      const std::uint64_t before = i > 0 ? in[i - 1] : 0;
      const std::uint64_t after = i + 1 < words ? in[i + 1] : 0;
      if ((here | before | after) == 0) {
        out[i] = 0;
        continue;
      }
      std::uint64_t bits = here;
      for (int k = 1; k <= by; ++k) bits |= here << k | before >> (64 - k) | here >> k | after << (64 - k);
      out[i] = bits;
    }
  }
}

void spread_over_rows(const BitImage& from, int by, int v_begin, int v_end, BitImage& to) {
  const int words = from.grid.words();
  for (int v = v_begin; v < v_end; ++v) {
    std::uint64_t* out = to.row(v);
    const int first = std::max(0, v - by);
    std::copy_n(from.row(first), words, out);
    for (int k = first + 1; k <= std::min(from.grid.height - 1, v + by); ++k) {
      const std::uint64_t* in = from.row(k);
      for (int i = 0; i < words; ++i) out[i] |= in[i];
    }
  }
}

}  // namespace tubetrack
