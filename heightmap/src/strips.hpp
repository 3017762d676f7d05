#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "surfel_region.hpp"
#include "tubetrack/heightmap/normals.hpp"

namespace tubetrack {

/// Cells [begin, end) of a row, or of a column: nearer than what is beyond both, with nothing in between.
struct StripRun {
  int line = 0;
  int begin = 0;
  int end = 0;
  float depth_m = 0.0F;  ///< mean
};

/// Buffers, and runs that are kept from frame to frame.
struct StripWork {
  Part rows;  ///< of the last frame
  double narrowest_px = 0.0, widest_px = 0.0;
  std::vector<StripRun> row_runs, column_runs;
  std::vector<std::size_t> first_of_line;  ///< in the runs; one more than there are lines
  std::vector<int> open;                   ///< by column, where the run that has not ended began
  std::vector<Surfel> of_rows, of_columns, surfels;
};

/// How far beside the wanted rows edges must be known: a strip across them is no longer.
inline constexpr int kEdgesForStrips_px = 36;

/// A tube too narrow for windows shows by both silhouettes instead: surfels of narrow strips that stand out from what
/// is behind them, each as if the strip's section were a half circle. (Whether it is one, the fit has to tell.) In cell
/// order, one a cell at most, in some rows alone, valid until the next call; `skip` as for SurfelFinder::find. `edges`
/// are known up to kEdgesForStrips_px beside the rows. `changed`: they, or heights, have since the last call.
std::span<const Surfel> strip_surfels(const HeightMap& map, const Heights& heights, const Edges& edges,
                                      const Part& rows, const AxialNoise& noise, const SurfelOptions& options,
                                      std::span<const std::uint8_t> skip, bool changed, StripWork& work);

}  // namespace tubetrack
