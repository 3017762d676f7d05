#include "bit_image.hpp"

#include <algorithm>

namespace tubetrack {

void spread_in_rows(const BitImage& from, int by, const WordArea& area, BitImage& to) {
  const int words = from.grid.words();
  for (int v = area.v_begin; v < area.v_end; ++v) {
    const std::uint64_t* in = from.row(v);
    std::uint64_t* out = to.row(v);
    for (int i = area.word_begin; i < area.word_end; ++i) {
      const std::uint64_t here = in[i];
      const std::uint64_t before = i > 0 ? in[i - 1] : 0;
      const std::uint64_t after = i + 1 < words ? in[i + 1] : 0;
      std::uint64_t bits = here;
      if ((here | before | after) != 0) {
        for (int k = 1; k <= by; ++k) bits |= here << k | before >> (64 - k) | here >> k | after << (64 - k);
      }
      out[i] = bits;
    }
  }
}

void spread_over_rows(const BitImage& from, int by, const WordArea& area, BitImage& to) {
  for (int v = area.v_begin; v < area.v_end; ++v) {
    std::uint64_t* out = to.row(v);
    const int first = std::max(0, v - by);
    const int last = std::min(from.grid.height - 1, v + by);
    std::copy(from.row(first) + area.word_begin, from.row(first) + area.word_end, out + area.word_begin);
    for (int k = first + 1; k <= last; ++k) {
      const std::uint64_t* in = from.row(k);
      for (int i = area.word_begin; i < area.word_end; ++i) out[i] |= in[i];
    }
  }
}

void keep_columns(int u_begin, int u_end, const WordArea& area, BitImage& image) {
  for (int i = area.word_begin; i < area.word_end; ++i) {
    const int first = 64 * i - kMargin_px;  // column of the word's lowest bit
    const int from = std::clamp(u_begin - first, 0, 64);
    const int to = std::clamp(u_end - first, 0, 64);
    const std::uint64_t below_from = from == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << from) - 1;
    const std::uint64_t below_to = to == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << to) - 1;
    for (int v = area.v_begin; v < area.v_end; ++v) image.row(v)[i] &= below_to & ~below_from;
  }
}

}  // namespace tubetrack
