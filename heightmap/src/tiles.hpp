#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "surfel_region.hpp"
#include "tubetrack/heightmap/height_map.hpp"

namespace tubetrack {

/// Which tiles of a map the surfels are up to date with.
class TileLedger {
 public:
  void start(const HeightMap& map);
  /// All tiles are due at the next call.
  void forget() { started_ = false; }

  /// Takes the heights of the tiles that are due: those that changed and, unless they are new, of whose cells that were
  /// steady when they were taken a sixteenth is elsewhere now (what flickers is soon back); those that were new and,
  /// refined since, have seen twice as many frames as when their heights were last taken; and, so that a slow drift is
  /// followed, a block of all tiles every few frames. The regions whose surfels depend on what was taken. `in_turns`:
  /// of the tiles that changed half is taken and half in the next call.
  std::span<const Region> take_due(const HeightMap& map, Heights& heights, Workers& workers, bool in_turns = false);
  /// Within the regions of the last call.
  AffectedTiles affected() const { return {affected_.data(), edges_affected_.data(), columns_}; }

 private:
  bool due(const HeightMap& map, int row, int column, const Heights& heights);
  bool has_moved(const HeightMap& map, const Region& cells, std::size_t tile, const Heights& heights);
  void choose_due(const HeightMap& map, int row, const Heights& heights);
  void put_off_half(const HeightMap& map);
  void take_row_of_tiles(const HeightMap& map, int row, Heights& heights);
  void mark_affected(const HeightMap& map, const Heights& heights, int row, int column);
  void mark(const Region& cells, std::vector<std::uint8_t>& flags) const;
  void gather_regions(const HeightMap& map);

  int rows_ = 0;
  int columns_ = 0;
  bool started_ = false;
  bool first_half_is_next_ = false;
  std::vector<std::uint32_t> taken_in_;  ///< by tile: the frame in which its heights were taken
  std::vector<std::int32_t> missing_;    ///< by tile: so many more steady cells must change for it to be due
  std::vector<std::uint8_t> taken_;      ///< by tile: in this call
  std::vector<std::uint8_t> put_off_;    ///< by tile: due in the last call, and taken in this one
  std::vector<std::uint8_t> affected_;   ///< by unit of rows and column of tiles: surfels depend on what was taken now
  std::vector<std::uint8_t> edges_affected_;  ///< the same for edges, and blocks beside holes
  std::vector<Region> regions_;
};

}  // namespace tubetrack
