#pragma once

#include <cstdint>
#include <vector>

#include "axial_noise.hpp"
#include "bit_image.hpp"
#include "tubetrack/heightmap/normals.hpp"
#include "window_planes.hpp"

namespace tubetrack {

/// Ray of every padded cell of a camera with distortion, a row of zeros before the first and after the last; empty for
/// one without, whose rays are cheaper to compute than to load.
struct RayTable {
  std::vector<float> x;
  std::vector<float> y;

  static std::size_t at(const Grid& grid, int u, int v) { return grid.at(u, v + 1); }
};

struct SurfelRule {
  AxialNoise noise;
  float fx_px = 0.0F;
  float fy_px = 0.0F;
  float cx_px = 0.0F;
  float cy_px = 0.0F;
  bool distorted = false;
  float lateral_px = 0.0F;  ///< NoiseModel's
  float gate_sigmas = 0.0F;
  /// Gates on second differences in the image, before any normal is computed: on their noise, and on how inverse depth
  /// bends, in 1/m per pixel (along u) squared. A ray aside meets a surface that leans its way in shorter steps, and
  /// with more curvature for the same bend, which is all by which the careful gate can be laxer than the first at
  /// gate_sigmas and the second at the curvature of the largest tube that can pass. 0 with distortion, which bends
  /// planes too.
  float screen_sigmas = 0.0F;
  float screen_bend_per_m = 0.0F;
  float radius_min_m = 0.0F;
  float radius_max_m = 0.0F;

  /// `longest_ray2`: the square of the longest (x/z, y/z).
  SurfelRule(const Intrinsics& in, float longest_ray2, const NoiseModel& model, const SurfelOptions& options);
  bool operator==(const SurfelRule&) const = default;
};

/// A surfel, as it is kept for its row.
struct FoundSurfel {
  int u;
  float x_m, y_m, z_m;
  float normal_x, normal_y, normal_z;
  float sigma_m;
  float radius_min_m, radius_max_m;
};

/// What the cells of a row are computed from: the planes in its row and half a window above and below.
struct Neighbourhood {
  PlaneRow row, above, below;
  const float* ray_x;  ///< of the row; only with distortion
  const float* ray_y;
  std::ptrdiff_t ray_stride;
  int u_begin;  ///< the image column of the planes' first
  int v;
  int half;
};

/// Lists the cells that are worth the careful gate, few and far between: those without a bit in `found` (of the padded
/// row) that bend down by more than the rule's screen. Returns how many. Columns are those of the planes: [begin, end)
/// of them. `candidates` has room for all.
int list_candidates(const SurfelRule& rule, const Neighbourhood& n, int begin, int end, const std::uint64_t* found,
                    std::int32_t* candidates);

/// Surfels from the planes of one size in row `v`, columns [u_begin, u_end): where `found` has no bit yet and the
/// curvature passes the gate. Sets the bits of `found` (of the padded row), and the surfels in `row` (by image column).
/// `candidates` is scratch: a padded row.
void surfels_of_row(const SurfelRule& rule, PlaneRing& planes, const RayTable& rays, const Grid& grid, int v,
                    int u_begin, int u_end, std::int32_t* candidates, std::uint64_t* found, FoundSurfel* row);

}  // namespace tubetrack
