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
    words.assign(static_cast<std::size_t>(to.words()) * static_cast<std::size_t>(to.height), 0);
  }
  std::uint64_t* row(int v) { return words.data() + static_cast<std::ptrdiff_t>(v) * grid.words(); }
  const std::uint64_t* row(int v) const { return words.data() + static_cast<std::ptrdiff_t>(v) * grid.words(); }
  bool get(int u, int v) const { return (row(v)[(u + kMargin_px) / 64] >> ((u + kMargin_px) % 64) & 1) != 0; }
  void set(int u, int v) { row(v)[(u + kMargin_px) / 64] |= std::uint64_t{1} << ((u + kMargin_px) % 64); }
};

/// Rows [v_begin, v_end) of words [word_begin, word_end).
struct WordArea {
  int v_begin = 0;
  int v_end = 0;
  int word_begin = 0;
  int word_end = 0;
};

/// A word of a row with the bits up to `by` ≤ 15 columns beside them; some come from the words beside it.
std::uint64_t spread_in_row(const std::uint64_t* word, int by);

/// `to` gets the bits of `from` in rows up to `by` above and below.
void spread_over_rows(const BitImage& from, int by, const WordArea& area, BitImage& to);

/// The same where those of `from` are spread over rows already, by at least `by`.
void spread_on_over_rows(const BitImage& from, int by, const WordArea& area, BitImage& to);

/// Clears the bits of columns outside [u_begin, u_end).
void keep_columns(int u_begin, int u_end, const WordArea& area, BitImage& image);

}  // namespace tubetrack
