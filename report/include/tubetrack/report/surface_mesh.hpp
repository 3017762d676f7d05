#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// Triangles, counter-clockwise seen from outside; points alone where there are no faces.
struct SurfaceMesh {
  std::vector<Eigen::Vector3d> points_m;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::array<std::uint8_t, 3>> colors;  ///< red, green, blue, one a point; empty: none
  std::vector<float> distance_m;                    ///< one a point, as PLY's property `distance`; empty: none
};

/// A centreline with `pieces` points between two nodes, on a smooth curve through the nodes (Catmull-Rom).
std::vector<Eigen::Vector3d> smooth_centerline(const Tube& tube, int pieces);

/// The tube's surface around its centreline: rings of `sides` points, flat caps at the ends of one that is not closed.
/// Straight parts are light blue, toric ones dark blue (as in the paper's figure), free ones orange.
SurfaceMesh surface_of(const Tube& tube, int sides = 48);

/// Appends a mesh to another; what one has and the other lacks (colours, distances) is filled up with zeros.
void append(SurfaceMesh& mesh, const SurfaceMesh& other);

/// How a surface differs from the tubes found in it.
struct SurfaceErrors {
  std::size_t on_tubes = 0;  ///< points nearer than 1.5 radii to a centreline: what the rest is about
  std::size_t off_tubes = 0;
  double min_m = 0.0, median_m = 0.0, percentile_95_m = 0.0, max_m = 0.0;
};

/// Sets each point's distance to the nearest tube's surface (unsigned; NaN beyond 1.5 radii of all centrelines) and its
/// colour: blue 0, over green and yellow to red at the 95th percentile; grey where the distance is NaN.
SurfaceErrors color_by_distance(SurfaceMesh& mesh, std::span<const Tube> tubes);

/// Writes .ply (text, with colours and distances), .obj (text) or .stl (binary; needs faces), by the name's extension.
/// Coordinates are metres. The error names the file and says what it takes.
Expected<void> write_mesh(const std::filesystem::path& path, const SurfaceMesh& mesh);

}  // namespace tubetrack
