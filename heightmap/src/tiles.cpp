#include "tiles.hpp"

#include <algorithm>

#include "fuse_row.hpp"

namespace tubetrack {

namespace {

/// How far a changed cell reaches: its surfels, and an edge between neighbours beside it.
constexpr int kReach_px = kSurfelReach_px + 1;
constexpr int kReachAside_px = kReach_px + kBesidePiece_px;
constexpr int kUnit_px = kAffectedRows_px;
constexpr int kUnitsPerTile = kTileHeight_px / kUnit_px;
/// The map is gone through again in blocks, so many across and down, one every few frames.
constexpr int kBlocks = 4;
constexpr int kFramesPerBlock = 4;
/// Rows and columns beside a region that are worked on for it, which makes one large region cheaper than two.
constexpr int kExtraColumns_px = 64;
constexpr int kExtraRows_px = 40;

std::int64_t cost(const Region& r) {
  return static_cast<std::int64_t>(r.u_end - r.u_begin + kExtraColumns_px) * (r.v_end - r.v_begin + kExtraRows_px);
}

Region hull(const Region& a, const Region& b) {
  return {std::min(a.u_begin, b.u_begin), std::max(a.u_end, b.u_end), std::min(a.v_begin, b.v_begin),
          std::max(a.v_end, b.v_end)};
}

/// The longest gap from a tile's side on, straight away from it along (du, dv), that an edge may lie across: what is in
/// the tile is compared with what is beyond. (`u`, `v`): the first cell outside; `count` of them beside each other.
int longest_gap(const Heights& heights, int u, int v, int du, int dv, int count) {
  const Grid& grid = heights.grid;
  int longest = 0;
  for (int i = 0; i < count; ++i) {
    for (int gap = 0; gap < kGapLimit_px; ++gap) {
      const int at_u = u + du * gap + (dv != 0 ? i : 0);
      const int at_v = v + dv * gap + (du != 0 ? i : 0);
      if (at_u < 0 || at_u >= grid.width || at_v < 0 || at_v >= grid.height) break;
      if (heights.height[grid.at(at_u, at_v)] == 0) continue;
      longest = std::max(longest, gap);
      break;
    }
  }
  return longest;
}

Region tile_at(const HeightMap& map, int row, int column) {
  return {column * kTileWidth_px, std::min((column + 1) * kTileWidth_px, map.intrinsics.width), row * kTileHeight_px,
          std::min((row + 1) * kTileHeight_px, map.intrinsics.height)};
}

}  // namespace

void TileLedger::start(const HeightMap& map) {
  rows_ = map.tile_rows();
  columns_ = map.tile_columns();
  const auto tiles = static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_);
  taken_in_.assign(tiles, 0);
  missing_.assign(tiles, 0);
  taken_.assign(tiles, 0);
  put_off_.assign(tiles, 0);
  affected_.assign(tiles * kUnitsPerTile, 0);
  edges_affected_.assign(tiles * kUnitsPerTile, 0);
  regions_.reserve(tiles * kUnitsPerTile);
  started_ = false;
}

/// Of a tile that changed: in one that is no longer new it may have been what flickers at silhouettes, most of which is
/// soon back where it was.
bool TileLedger::has_moved(const HeightMap& map, const Region& cells, std::size_t tile, const Heights& heights) {
  if (map.tile_changed_in[tile] - map.tile_new_in[tile] < kYoungFrames) return true;
  // Counted again once so many more cells changed as were missing.
  std::int32_t& missing = missing_[tile];
  missing -= static_cast<std::int32_t>(map.tile_changes[tile].steady);
  if (missing > 0) return false;
  const int all = (cells.u_end - cells.u_begin) * (cells.v_end - cells.v_begin);
  missing = (all + 15) / 16 - count_moved(map, cells, heights);
  return missing <= 0;
}

bool TileLedger::due(const HeightMap& map, int row, int column, const Heights& heights) {
  const std::size_t tile =
      static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  const std::uint32_t taken = taken_in_[tile];
  if (!started_ || put_off_[tile]) return true;
  if (map.tile_changed_in[tile] > taken && has_moved(map, tile_at(map, row, column), tile, heights)) return true;
  const std::uint32_t frames_then = taken - map.tile_new_in[tile] + 1;
  const std::uint32_t frames_now = map.frame - map.tile_new_in[tile] + 1;
  if (frames_then < 32) return frames_now >= 2 * frames_then;
  const auto block = static_cast<int>(map.frame / kFramesPerBlock % (kBlocks * kBlocks));
  return map.frame % kFramesPerBlock == 0 && map.frame != taken && block / kBlocks == row * kBlocks / rows_ &&
         block % kBlocks == column * kBlocks / columns_;
}

void TileLedger::mark_affected(const HeightMap& map, const Heights& heights, int row, int column) {
  const Region tile = tile_at(map, row, column);
  const int rows = tile.v_end - tile.v_begin;
  const int columns = tile.u_end - tile.u_begin;
  // A neighbour's gap that has closed since is of a tile that was taken as well, which marks what is beyond.
  const int left = longest_gap(heights, tile.u_begin - 1, tile.v_begin, -1, 0, rows);
  const int right = longest_gap(heights, tile.u_end, tile.v_begin, 1, 0, rows);
  const int above = longest_gap(heights, tile.u_begin, tile.v_begin - 1, 0, -1, columns);
  const int below = longest_gap(heights, tile.u_begin, tile.v_end, 0, 1, columns);
  // Gaps are looked across along rows and columns only.
  const auto mark_around = [&](int rows_px, std::vector<std::uint8_t>& flags) {
    mark({tile.u_begin - kReachAside_px - left, tile.u_end + kReachAside_px + right, tile.v_begin - rows_px,
          tile.v_end + rows_px},
         flags);
    if (above == 0 && below == 0) return;
    mark({tile.u_begin - kReachAside_px, tile.u_end + kReachAside_px, tile.v_begin - rows_px - above,
          tile.v_end + rows_px + below},
         flags);
  };
  mark_around(kReach_px, affected_);
  mark_around(1, edges_affected_);
}

void TileLedger::mark(const Region& cells, std::vector<std::uint8_t>& flags) const {
  const int first = std::max(0, cells.u_begin) / kTileWidth_px;
  const int last = std::min(columns_ - 1, (cells.u_end - 1) / kTileWidth_px);
  const int above = std::max(0, cells.v_begin) / kUnit_px;
  const int below = std::min(rows_ * kUnitsPerTile, (cells.v_end + kUnit_px - 1) / kUnit_px);
  for (int unit = above; unit < below; ++unit) {
    std::fill_n(flags.begin() + unit * columns_ + first, last - first + 1, std::uint8_t{1});
  }
}

/// What is affected as rectangles: runs of tiles of a row of units, joined with each other and with those above where
/// that is less work than each on its own.
void TileLedger::gather_regions(const HeightMap& map) {
  const int width = map.intrinsics.width;
  const int height = map.intrinsics.height;
  regions_.clear();
  for (int unit = 0; unit * kUnit_px < height; ++unit) {
    for (int column = 0; column < columns_; ++column) {
      const std::uint8_t* tiles = affected_.data() + static_cast<std::ptrdiff_t>(unit) * columns_;
      if (!tiles[column]) continue;
      const int first = column;
      while (column < columns_ && tiles[column]) ++column;
      const Region run{first * kTileWidth_px, std::min(column * kTileWidth_px, width), unit * kUnit_px,
                       std::min((unit + 1) * kUnit_px, height)};
      const auto joined = std::find_if(regions_.rbegin(), regions_.rend(), [&](const Region& region) {
        return region.v_end >= run.v_begin && cost(hull(region, run)) <= cost(region) + cost(run);
      });
      if (joined == regions_.rend()) {
        regions_.push_back(run);
      } else {
        *joined = hull(*joined, run);
      }
    }
  }
}

void TileLedger::choose_due(const HeightMap& map, int row, const Heights& heights) {
  const std::size_t row_start = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
  for (int column = 0; column < columns_; ++column) {
    taken_[row_start + static_cast<std::size_t>(column)] = due(map, row, column, heights) ? 1 : 0;
  }
}

/// Of the tiles that are due because they changed, row by row, the first half or the second. What was put off before is
/// taken now.
void TileLedger::put_off_half(const HeightMap& map) {
  const auto is_changed = [&](std::size_t tile) { return taken_[tile] && map.tile_changed_in[tile] > taken_in_[tile]; };
  int count = 0;
  for (std::size_t tile = 0; tile < taken_.size(); ++tile) count += is_changed(tile) ? 1 : 0;
  int so_far = 0;
  first_half_is_next_ = !first_half_is_next_;
  for (std::size_t tile = 0; tile < taken_.size(); ++tile) {
    const bool waits = is_changed(tile) && (2 * so_far < count) != first_half_is_next_;
    so_far += is_changed(tile) ? 1 : 0;
    put_off_[tile] = waits && !put_off_[tile] ? 1 : 0;
    if (put_off_[tile]) taken_[tile] = 0;
  }
}

/// Takes the chosen ones of a row of tiles, run by run.
void TileLedger::take_row_of_tiles(const HeightMap& map, int row, Heights& heights) {
  const std::size_t row_start = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
  const std::uint8_t* taken = taken_.data() + row_start;
  for (int column = 0; column < columns_; ++column) {
    if (!taken[column]) continue;
    const int first = column;
    for (; column < columns_ && taken[column]; ++column) {
      const std::size_t tile = row_start + static_cast<std::size_t>(column);
      taken_in_[tile] = map.frame;
      missing_[tile] = 0;
    }
    const Region cells{first * kTileWidth_px, std::min(column * kTileWidth_px, map.intrinsics.width),
                       row * kTileHeight_px, std::min((row + 1) * kTileHeight_px, map.intrinsics.height)};
    take_heights(map, cells, heights);
  }
}

std::span<const Region> TileLedger::take_due(const HeightMap& map, Heights& heights, Workers& workers, bool in_turns) {
  for (auto* flags : {&affected_, &edges_affected_}) std::fill(flags->begin(), flags->end(), std::uint8_t{0});
  const auto by_rows = [&](auto&& of_row) {
    workers.run([&](int i) {
      const Part rows = part_of(rows_, i, workers.count());
      for (int row = rows.begin; row < rows.end; ++row) of_row(row);
    });
  };
  by_rows([&](int row) { choose_due(map, row, heights); });
  if (in_turns && started_) {
    put_off_half(map);
  } else {
    std::fill(put_off_.begin(), put_off_.end(), std::uint8_t{0});
  }
  by_rows([&](int row) { take_row_of_tiles(map, row, heights); });
  started_ = true;
  const bool all = std::find(taken_.begin(), taken_.end(), std::uint8_t{0}) == taken_.end();
  for (auto* flags : {&affected_, &edges_affected_}) {
    if (all) std::fill(flags->begin(), flags->end(), std::uint8_t{1});
  }
  for (int row = 0; row < rows_ && !all; ++row) {
    for (int column = 0; column < columns_; ++column) {
      if (taken_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column)])
        mark_affected(map, heights, row, column);
    }
  }
  gather_regions(map);
  return regions_;
}

}  // namespace tubetrack
