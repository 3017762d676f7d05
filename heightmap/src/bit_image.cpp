#include "bit_image.hpp"

#include <algorithm>

namespace tubetrack {

std::uint64_t spread_in_row(const std::uint64_t* word, int by) {
  const std::uint64_t before = word[-1];
  const std::uint64_t here = word[0];
  const std::uint64_t after = word[1];
  if ((before | here | after) == 0) return 0;
  // With what comes in from either side, twice as far with each step.
  std::uint64_t up = here, up_before = before;
  std::uint64_t down = here, down_after = after;
  for (int done = 0; done < by;) {
    const int step = std::min(done + 1, by - done);
    up |= up << step | up_before >> (64 - step);
    up_before |= up_before << step;
    down |= down >> step | down_after << (64 - step);
    down_after |= down_after >> step;
    done += step;
  }
  return up | down;
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

void spread_on_over_rows(const BitImage& from, int by, const WordArea& area, BitImage& to) {
  for (int v = area.v_begin; v < area.v_end; ++v) {
    const std::uint64_t* above = from.row(std::max(0, v - by));
    const std::uint64_t* below = from.row(std::min(from.grid.height - 1, v + by));
    std::uint64_t* out = to.row(v);
    for (int i = area.word_begin; i < area.word_end; ++i) out[i] = above[i] | below[i];
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
