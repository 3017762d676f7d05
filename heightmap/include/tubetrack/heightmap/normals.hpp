#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "tubetrack/heightmap/height_map.hpp"
#include "tubetrack/heightmap/surfel.hpp"

namespace tubetrack {

/// How surfels are found in a height map.
struct SurfelOptions {
  double radius_min_m = 0.005;
  double radius_max_m = 0.100;
  double gate_sigmas = 4.0;  ///< curvature over its own σ, above which a surfel may be a tube's
  /// Strips so wide that stand out from what is behind them give surfels by their silhouettes where their curvature
  /// does not show; 0: none.
  double narrowest_strip_px = 0.0;
  double widest_strip_px = 0.0;
  /// Rows [v_begin, v_end) of the image in which surfels are wanted; those are the same as where all rows are.
  int v_begin = 0;
  int v_end = std::numeric_limits<int>::max();
  /// Of what changed since the last call about half is looked at in this one and the other half in the next: a surfel
  /// may be of how things were in the call before.
  bool in_turns = false;
};

/// Half sizes of the square windows, in pixels: 7, 13 and 21 px across.
inline constexpr std::array<int, 3> kWindowHalfSizes_px{3, 6, 10};

/// Finds the surfels of everything curved like a tube of the wanted radii: each cell with the largest window that
/// stays on one side of depth edges, gated on convex curvature over its σ, with the band of radii that this curvature
/// allows. Of odd rows those 16 columns at a time above which there is one, or up to 8 columns beside. Keeps its
/// buffers, and what did not change, from frame to frame of one map.
class SurfelFinder {
 public:
  SurfelFinder();
  SurfelFinder(SurfelFinder&&) noexcept;
  SurfelFinder& operator=(SurfelFinder&&) noexcept;
  ~SurfelFinder();

  /// Takes the memory for maps of this size, so that the first frame need not.
  void make_room(const HeightMap& map, const Workers& workers);

  /// In cell order, valid until the next call. `skip`: empty, or one a cell; where it is not 0 no surfel is wanted,
  /// though the cell still takes part in windows. The result does not depend on the workers.
  std::span<const Surfel> find(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options,
                               std::span<const std::uint8_t> skip, Workers& workers);
  std::span<const Surfel> find(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options,
                               std::span<const std::uint8_t> skip = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The surfels of one map, by a finder of its own.
std::vector<Surfel> tube_surfels(const HeightMap& map, const NoiseModel& noise, const SurfelOptions& options);

}  // namespace tubetrack
