#pragma once

#include <cstdint>
#include <vector>

#include "grid.hpp"

namespace tubetrack {

/// One bit a padded cell.
struct BitImage {
  Grid grid;
  std::vector<std::uint64_t> words;

  void resize(const Grid& to) {
    grid = to;
    words.assign(static_cast<std::size_t>(to.words() * to.height), 0);
  }
  std::uint64_t* row(int v) { return words.data() + static_cast<std::ptrdiff_t>(v) * grid.words(); }
  const std::uint64_t* row(int v) const { return words.data() + static_cast<std::ptrdiff_t>(v) * grid.words(); }
  bool get(int u, int v) const { return (row(v)[(u + kMargin_px) / 64] >> ((u + kMargin_px) % 64) & 1) != 0; }
  void set(int u, int v) { row(v)[(u + kMargin_px) / 64] |= std::uint64_t{1} << ((u + kMargin_px) % 64); }
};

/// `to` gets, in rows [v_begin, v_end), the bits of `from` and those up to `by` ≤ 15 columns beside them.
void spread_in_rows(const BitImage& from, int by, int v_begin, int v_end, BitImage& to);

/// `to` gets, in rows [v_begin, v_end), the bits of `from` in rows up to `by` above and below.
void spread_over_rows(const BitImage& from, int by, int v_begin, int v_end, BitImage& to);

}  // namespace tubetrack
